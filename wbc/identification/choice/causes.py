"""The order of the search: what acts at once, then links that swing behind their gears."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from wbc.identification.choice.credibility import at_the_end
from wbc.identification.choice.exchange import settle
from wbc.identification.choice.gear_pairs import best_pairs, loudest
from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.pattern_search import FAR, NEAR, pattern_search
from wbc.identification.choice.selection import SIMPLER, Selector
from wbc.identification.choice.unexplained import unexplained
from wbc.identification.model.problem import ONLY_NOISE, Problem
from wbc.identification.model.yielding import deflects, loose
from wbc.robot import Effect

_EXPLAINED = 1.3  # held-out mean square below which effects with a hidden state are not tried
_WORTHWHILE = 0.7  # of the error that a swinging link must promise to leave at most
_HALF = 0.5  # of the error, left by the best cause that acts at once, from which on ...
_FAR = 0.3  # ... links that swing come first, if they leave so little of what that cause leaves
_CLEAR = 0.1  # ... and nothing else is sought in their place, if in the end they leave this
_FILTERED = 0.01  # share of the first error that filters and derivatives distort
_WEAK = 9.0  # first error up to which what acts at once may do as well as a link that swings
_NOT_ALL = 0.03  # of the error (rms), beyond which a loose gear may not be alone
_ROUNDS = 3  # in which numbers of gears that strike are tried one by one ...
_CALMER = 0.8  # ... as long as so little of the error is left
_ALIKE = 1.3  # times the least error, up to which the simpler pair is taken
_PAIRED = 0.8  # of the error, that two gears from a coarse grid must leave at most
_SEVERAL = 2  # causes that act at once, in whose place one swinging link may do
_NEARLY = 1.25  # of an error, that a model inside its ranges may leave and be preferred
_SIMULATED = 0.04  # share of the first error to which links behind soft gears are simulated

_Search = tuple[list[Model], Model]


@dataclass(frozen=True, eq=False)
class _Kinds:
    """The search among all causes, among those that act at once, and among links that swing."""

    everything: Selector
    direct: Selector
    swinging: Selector

    @classmethod
    def of(cls, everything: Selector) -> _Kinds:
        """Return the same search among fewer causes."""
        swinging = tuple(c for c in everything.candidates if deflects(c))
        return cls(everything, everything.at_once, replace(everything, candidates=swinging))

    @property
    def first(self) -> Model:
        """The model without causes."""
        return self.everything.model(())

    @cached_property
    def pair(self) -> Model | None:
        """The two gears that explain most together, at least one of them loose; None if little."""
        problem = self.everything.problem
        pairs, logs = best_pairs(problem, self.swinging.candidates), loudest(problem)
        begun = [pair.effects for pair in pairs if pair.share < _PAIRED]
        tried = [pattern_search(problem, effects, FAR, logs) for effects in begun]
        if not tried:
            return None
        least = min(left for _, left in tried)
        # Without play a loose gear is a soft one, with a number more.
        alike = [effects for effects, left in tried if left < _ALIKE * least]
        simplest = min(alike, key=lambda effects: sum(e.freedom for e in effects))
        return self.settled(self.everything.model(simplest))

    def swung(self, origin: Model, enough: float) -> list[Model]:
        """Return models with one swinging link more each, while they pay and much is left."""
        result = [origin]
        while result[-1].error >= enough:
            longer = self._swung_once(result[-1])
            if longer is None:
                break
            result.append(longer)
        return result[1:]

    def _swung_once(self, model: Model) -> Model | None:
        most = _WORTHWHILE * model.error
        if not loose(model.effects):
            longer = self.swinging.best_addition(model, self.first, most)
            if longer is not None and loose(longer.effects):
                longer = self.settled(longer)
            # Beside one link that swings every other is tried, whatever it promises.
            beside = longer is not None and model.swings and longer.error > most
            return None if beside else longer
        # A loose gear found alone holds in its numbers what another one does.
        if len(model.effects) > 1 or self.pair is None or self.pair.error > most:
            return None
        return self.pair if self.swinging.worthwhile(model, self.pair, self.first) else None

    def settled(self, model: Model) -> Model:
        """Return a model with a loose gear with better numbers of its gears, where there are."""
        problem = self.everything.problem
        for _ in range(_ROUNDS):
            effects, _ = pattern_search(problem, model.effects, NEAR, problem.records)
            other = self.everything.model(effects)
            if other.error > _CALMER * model.error:
                return min((model, other), key=lambda m: m.error)
            model = other
        return model


def find_causes(
    problem: Problem, classes: Sequence[type[Effect]], report: Callable[[str], None]
) -> tuple[Selector, list[Model], Model]:
    """Return the search, its path and the model chosen.

    Effects with a hidden state are simulated, which is slow. They are tried where effects that act
    at once leave something: alone, since a swinging link looks like several other causes at
    once, beside what was found, and where neither explains the logs beside the first cause;
    whatever acts at once is then sought anew. Where little was to be explained, they are tried
    alone in any case, and what is found may be exchanged for them. Where no cause that acts at
    once explains half, swinging links come first: if they explain everything or far more than any
    of those, nothing is sought in their place but what `settle` exchanges.

    Args:
        problem: the logs.
        classes: effects that may be used.
        report: called with a line of text as the work proceeds.
    """
    kinds = _Kinds.of(Selector(problem, tuple(classes), report=report))
    first, direct = kinds.first, kinds.direct
    rough = _EXPLAINED + _SIMULATED**2 * first.error
    start = direct.best_addition(first, first)
    left = first.error if start is None else start.error
    early: _Search | None = None
    if left > _HALF * first.error:
        swung = kinds.swung(first, rough)
        if swung and swung[-1].error < _FAR * left:
            early = _finish(direct, [first, *swung], first)
            if early[1].error < max(rough, _CLEAR * left):
                return _with_a_pair(kinds, kinds.everything, *early)
    begun = [first] if start is None else [first, start]
    found = _tried_again(direct, *_finish(direct, begun, first))
    return _with_a_pair(kinds, *_beside_swings(kinds, found, early, rough))


def _beside_swings(
    kinds: _Kinds, found: _Search, early: _Search | None, rough: float
) -> tuple[Selector, list[Model], Model]:
    """Return the search among causes that act at once, or one with links that swing.

    Args:
        kinds: of searches.
        found: without such links.
        early: from such links alone, where it was made before.
        rough: mean square that is nothing but noise where links are simulated.
    """
    (path, final), first, problem = found, kinds.first, kinds.everything.problem
    fine = _EXPLAINED + _FILTERED**2 * first.error
    # Simulated links are themselves off by a share; a lower bound calls for nothing finer.
    explained = fine if problem.floor.repeats else rough
    one, weak = len(final.effects) < _SEVERAL, first.error < _WEAK
    best = (kinds.everything if weak else kinds.direct), path, final
    # What was added after the first cause may imitate the link that swings beside it.
    for origin in dict.fromkeys((first, final, *path[1:2])) if kinds.swinging.candidates else ():
        known = best[2].error < explained
        if known and (origin is not first or (one and not weak)):
            break
        if origin not in (first, final) and not unexplained(problem, first.error, best[2]):
            break
        swung = kinds.swung(origin, explained)
        # Where causes that act at once explain everything, only what does it alone replaces them.
        if not swung or (known and swung[-1].error >= explained):
            continue
        begun = [*dict.fromkeys((first, origin)), *swung]
        longer, other = early or _finish(kinds.direct, begun, first)
        early = None
        if _better(kinds.direct, other, best[2], first):
            best = kinds.everything, longer, other
            explained = rough
    return best


def _with_a_pair(
    kinds: _Kinds, selector: Selector, path: list[Model], final: Model
) -> tuple[Selector, list[Model], Model]:
    """Return the search, or where much is left one that begins with two gears that yield at once.

    Of two loose gears each alone may explain nothing: the links throw one another.
    """
    first, problem = kinds.first, selector.problem
    enough = max(_EXPLAINED, _NOT_ALL**2 * first.error)
    clear = final.error < enough or not loose(final.effects)
    if clear and not unexplained(problem, first.error, final):
        return selector, path, final
    both = kinds.pair
    if both is None or both.error > _HALF * final.error:
        return selector, path, final
    longer, found = _finish(kinds.direct, [first, both], first)
    if not _better(kinds.direct, found, final, first):
        return selector, path, final
    return kinds.everything, longer, found


def _tried_again(direct: Selector, path: list[Model], final: Model) -> _Search:
    """Return the search, or where much is left one without some of its causes that does better.

    What lies at the end of its range, or else was added first, may hide what explains everything:
    a gear that loses only while driven backward stood for friction and an offset. Where that does
    not explain everything either, numbers inside their range are believed more.
    """
    first, problem = path[0], direct.problem
    if len(path) < 2 or not unexplained(problem, first.error, final):
        return path, final
    ends = _at_an_end(final)
    aside = frozenset(e.key for e in ends or path[1].effects)
    longer, found = _finish(replace(direct, aside=aside), [first], first)
    explained = not unexplained(problem, first.error, found) and direct.pays(final, found, first)
    believed = ends and not _at_an_end(found) and found.error < _NEARLY * final.error
    return (longer, found) if explained or believed else (path, final)


def _at_an_end(model: Model) -> tuple[Effect, ...]:
    ends = {model.fit.parameters[row][0] for row in at_the_end(model.fit)}
    return tuple(model.effects[k] for k in sorted(ends))


def _finish(direct: Selector, path: list[Model], first: Model) -> _Search:
    """Return a path continued by what acts at once, and what of its end still pays.

    What is hardly above the noise is sought after an exchange of what is found by then: beside a
    cause that has more numbers than another which does as well, the noise makes up small causes.
    """
    longer = direct.run(path, ONLY_NOISE)
    final = direct.prune(longer[-1], first)
    # A simulation turns noise into swings, which nothing that acts at once may write down.
    if final.error >= ONLY_NOISE or final.swings:
        return longer, final
    settled, _ = settle(direct, final, first)
    if settled is not longer[-1]:
        longer = [first, settled] if settled.effects else [first]
    longer = direct.run(longer)
    return longer, direct.prune(longer[-1], first)


def _better(judge: Selector, found: Model, known: Model, first: Model) -> bool:
    """Whether a model does better, or as well while it asks for less to be believed."""
    if judge.pays(known, found, first):
        return True
    return found.complexity < known.complexity - SIMPLER and not judge.pays(found, known, first)
