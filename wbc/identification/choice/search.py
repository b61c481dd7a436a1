"""The search for causes: single moves from one hypothesis to the next while the evidence grows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from wbc.identification.choice.certainty import doubted_names
from wbc.identification.choice.drop_screen import losses
from wbc.identification.choice.evidence import Hypothesis, Key, Offer, left_to_gain, without
from wbc.identification.choice.plain_models import plain_fits
from wbc.identification.choice.prior import LEAST_ASKED
from wbc.identification.choice.proposals import MISSED, Proposer
from wbc.identification.model.yielding import deflects
from wbc.identification.records.record import Record
from wbc.robot import Effect, Robot

_ADDED = 6  # offers that are fitted for one addition
_PAIRS = 6  # ... of two causes
_SWAPPED = 5  # ... that are looked at in the place of one cause
_ROUNDING = 1e-9  # of a torque
_MOST_MOVES = 60
_AGAIN = 0.9  # of its error, that causes tried again with other numbers must leave at most
_MASKS = 2  # times that what explains most and is not believed is put aside
# Hypotheses in a row that may hold a wrong drawing and a name that is not believed, be it the
# drawing or one beside it: the move after it can still confirm or remove it. The ten numbers per
# link of a drawing take up a part of whatever is missing, so that the search goes on beside it
# without end: TIAGo's arm ends after 45 s instead of 400 s, with the same seven frictions; Go2's
# legs after 170 s instead of more than 800 s. Without a drawing, causes doubted half-way may be
# right when the rest is found: to end there leaves 1.24 times as much at joint 2 of TIAGo's arm. A
# removal is no chance: nothing was added that could confirm it.
_CHANCES = 2
_MASKING = 0.8  # of the error, below which a cause that is not believed may hide others


def _additions(proposer: Proposer, h: Hypothesis, exclude: Sequence[Key] = ()) -> list[Hypothesis]:
    """Return hypotheses with a cause more, at one place or in all gears."""
    trials = proposer.trials
    longer = trials.rivals_of(h, proposer.beside(h, _ADDED, exclude))
    # What no machine is likely to have at one joint must not hide what is there at others.
    longer += trials.rivals_of(h, [own for one in longer if (own := _likely(one, h))])
    # Screens see a drive's causes only as the last to act.
    robot, record = trials.problem.robot, trials.problem.records[0]
    orders = [offer for one in longer for offer in _reordered(one, record, robot)]
    first = _placed_first(h, proposer.candidates, record, robot)
    kept = [offer for offer in first if not {e.key for e in offer} & {*exclude}]
    return [*longer, *trials.rivals_of(h, [*orders, *proposer.with_more(h, kept)])]


def _likely(longer: Hypothesis, h: Hypothesis) -> Offer:
    """Return a longer hypothesis without causes that are too unlikely, empty where none stays."""
    unlikely = longer.unlikely
    kept = without(longer.effects, *unlikely)
    return kept if unlikely and len(h.effects) < len(kept) else ()


def _usual(proposer: Proposer, h: Hypothesis) -> list[Hypothesis]:
    """Return, from the robot as given, what the joints of machines usually have, all at once.

    Found one by one they take a move each, and at every move what is still missing is imitated.
    """
    return [] if h.effects else plain_fits(proposer.trials, proposer.candidates, links=False)


def _drops(proposer: Proposer, h: Hypothesis) -> Iterator[Hypothesis]:
    """Yield hypotheses without a cause, a name at all its places, or all that says too little.

    Those alone are fitted of which the derivatives say that they may win, the most likely first.
    """
    trials, single = proposer.trials, [(effect,) for effect in h.effects]
    named = [_named(h, name) for name in _repeated(h)]
    # How links move behind gears that yield is no linear matter: without such a gear it is fitted.
    gears = [own for own in (*single, *named) if any(map(deflects, own))]
    offers = [own for own in (*single, *named) if own not in gears]
    fit = trials.fit(h)
    each = dict(zip(offers, losses(trials.problem, fit, h, offers), strict=True))
    idle = tuple(own[0] for own in single if own in each and each[own][0] < each[own][1])
    if len(idle) > 1:
        each[idle] = losses(trials.problem, fit, h, [idle])[0]
    likely = [own for own, (loss, gain) in each.items() if loss < MISSED * gain]
    likely.sort(key=lambda own: each[own][0] - each[own][1])
    for own in (*likely, *gears):
        yield from trials.rivals_of(h, [without(h.effects, *own)])


def _swaps(proposer: Proposer, h: Hypothesis) -> Iterator[Hypothesis]:
    """Yield hypotheses with another cause in the place of one, the most promising first."""
    for offer in proposer.exchanges(h, _SWAPPED):
        yield from proposer.trials.rivals_of(h, [offer])


def _pairs(proposer: Proposer, h: Hypothesis) -> list[Hypothesis]:
    """Return hypotheses with two causes more that may hide one another."""
    return [] if h.swings else proposer.trials.rivals_of(h, proposer.pairs_beside(h, _PAIRS))


def _repeated(h: Hypothesis) -> list[str]:
    names = [effect.name for effect in h.effects]
    return [name for name in dict.fromkeys(names) if names.count(name) > 1]


def _named(h: Hypothesis, name: str) -> tuple[Effect, ...]:
    return tuple(effect for effect in h.effects if effect.name == name)


def _reordered(h: Hypothesis, record: Record, robot: Robot) -> list[Offer]:
    """Return the effects with the last drive effect before others that act on the same motor.

    The order in which causes were found is no evidence of the order in which they act. Effects on
    other joints commute, and so do two of which each multiplies the torque by a number.

    Args:
        h: the hypothesis.
        record: one log.
        robot: without effects.
    """
    drives = [k for k, effect in enumerate(h.effects) if _drives(effect)]
    if not drives or drives[-1] != len(h.effects) - 1:
        return []
    *others, last = h.effects
    scales = _scales(last, record, robot)
    places = [
        k
        for k in drives[:-1]
        if _same_motor(others[k], last) and not (scales and _scales(others[k], record, robot))
    ]
    return [(*others[:k], last, *others[k:]) for k in places]


def _placed_first(
    h: Hypothesis, candidates: Sequence[type[Effect]], record: Record, robot: Robot
) -> list[Offer]:
    """Return the effects with one drive effect more that acts before those there are.

    Beside a limit, what weakens a drive before it explains nothing where it acts behind it.

    Args:
        h: what one more is put to.
        candidates: effect classes that may be used.
        record: one log.
        robot: without effects.
    """
    drives = [k for k, effect in enumerate(h.effects) if _drives(effect)]
    # One more begins with numbers that change nothing: it commutes with what is a factor.
    drives = [k for k in drives if not _scales(h.effects[k], record, robot)]
    offers = []
    for kind in candidates if drives else ():
        for where in kind.places(robot) if "drive" in kind.acts_by else ():
            if (kind.name, where) in h.keys:
                continue
            new = kind.at(where, kind.null_values(robot, where))
            places = (k for k in drives if _same_motor(h.effects[k], new))
            if (k := next(places, None)) is not None:
                offers.append((*h.effects[:k], new, *h.effects[k:]))
    return offers


def _drives(effect: Effect) -> bool:
    return "drive" in effect.acts_by


def _same_motor(one: Effect, other: Effect) -> bool:
    """Whether two drive effects meet: what acts on a joint is at its motor, the rest on all."""
    return one.where == other.where or "robot" in (one.where, other.where)


def _scales(effect: Effect, record: Record, robot: Robot) -> bool:
    """Whether a drive effect multiplies the reported torque by a number, the same at all times."""
    power = np.einsum("nk,nk->k", record.torque, record.torque)
    delivered = effect.drive(robot, record.motion, record.torque)
    gain = np.einsum("nk,nk->k", record.torque, delivered) / np.maximum(power, 1e-300)
    return bool(np.allclose(delivered, gain * record.torque, rtol=_ROUNDING))


@dataclass(eq=False)
class Search:
    """Climbs from a hypothesis by single moves.

    Attributes:
        proposer: of causes, with the trials.
        report: called with a line of text as the work proceeds.
        path: every hypothesis that was the best so far.
    """

    proposer: Proposer
    report: Callable[[str], None] = lambda line: None
    path: list[Hypothesis] = field(default_factory=list)

    def climb(self, start: Hypothesis) -> Hypothesis:
        """Return the hypothesis from which no move adds to the evidence.

        Which hypothesis says how many samples are independent differs from move to move, so that
        moves may lead back to causes that were left: of such a circle the best one is returned.
        """
        current, been = start, {frozenset(start.keys): start}
        held: Counter[str] = Counter()
        shorter = False
        for _ in range(_MOST_MOVES):
            drawn = any(effect.search.departures(effect).size for effect in current.effects)
            doubted = doubted_names(self.proposer.trials, current) if drawn else ()
            held = Counter({name: held[name] + (not shorter) for name in doubted})
            lasting = [name for name, count in held.items() if count >= _CHANCES]
            if lasting:
                # It does not reach the answer, nor does what rests on it.
                names = ", ".join(lasting)
                self.report(f"nothing more is tried beside what is not believed: {names}")
                break
            better = self._next(current)
            if better is None:
                break
            self._tell(current, better)
            before = been.get(frozenset(better.keys))
            if before is not None and better.error > _AGAIN * before.error:
                return self.proposer.trials.best_of(list(been.values()))
            shorter = len(better.effects) < len(current.effects)
            current = better
            been[frozenset(current.keys)] = current
            self.path.append(current)
        return current

    def lengthen(self, start: Hypothesis) -> Hypothesis:
        """Return the hypothesis beside which no cause more, and no pair, adds to the evidence."""
        current = start
        for _ in range(_MOST_MOVES):
            better = self._addition(current) or self._pair(current)
            if better is None:
                break
            self._tell(current, better)
            current = better
            self.path.append(current)
        return current

    def best(self, pool: Iterable[Hypothesis], than: Hypothesis) -> Hypothesis | None:
        """Return the believable hypothesis with the most evidence, None where it is `than`."""
        others = [h for h in pool if h is not than and h.believable]
        best = self.proposer.trials.best_of([than, *others])
        return None if best is than else best

    def _next(self, current: Hypothesis) -> Hypothesis | None:
        proposer = self.proposer
        best = f"best so far {current.error**0.5:.2f} noise floors"
        for fewer in _drops(proposer, current) if current.effects else ():
            if shorter := self.best([fewer], current):
                return shorter
        room = left_to_gain(proposer.trials.problem, current) > LEAST_ASKED
        if room:
            self.report(f"trying one effect more ({best})")
        more = self._addition(current) if room else None
        if several := self.best(_usual(proposer, current), more or current):
            return several
        if more:
            return more
        if current.effects:
            self.report(f"trying others in the place of what was found ({best})")
            for other in _swaps(proposer, current):
                if exchanged := self.best([other], current):
                    return exchanged
        self.report(f"trying two effects more ({best})")
        return self._pair(current)

    def _pair(self, current: Hypothesis) -> Hypothesis | None:
        """Return the best pair of causes of those that add to the evidence by themselves.

        Each is weighed alone against the current hypothesis first: one that explains another joint
        must not say how many samples are independent at this one.
        """
        pairs = [self.best([h], current) for h in _pairs(self.proposer, current)]
        return self.best([h for h in pairs if h is not None], current)

    def _addition(self, current: Hypothesis) -> Hypothesis | None:
        """Return the best hypothesis with a cause more, none of those that are left out.

        What explains much by impossible numbers hides what explains less: it is put aside.
        """
        exclude: list[Key] = []
        for _ in range(_MASKS + 1):
            longer = _additions(self.proposer, current, exclude)
            if better := self.best(longer, current):
                return better
            masks = [h for h in longer if h.error < _MASKING * current.error]
            if not masks:
                return None
            exclude += [key for h in masks for key in h.keys if key not in current.keys]
        return None

    def _tell(self, before: Hypothesis, after: Hypothesis) -> None:
        added = [
            f"+ {name} at {where}" for name, where in after.keys if (name, where) not in before.keys
        ]
        gone = [
            f"- {name} at {where}" for name, where in before.keys if (name, where) not in after.keys
        ]
        self.report(f"{', '.join(added + gone)}: {after.error**0.5:.2f} noise floors")
