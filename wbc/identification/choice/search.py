"""The search for causes: from one hypothesis to the next while the evidence grows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from wbc.identification.choice import moves
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.weighing.certainty import doubted_names
from wbc.identification.choice.weighing.evidence import left_to_gain, weigh
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key
from wbc.identification.choice.weighing.prior import LEAST_ASKED

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
                return best_of(self, list(been.values()))
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
        group = [than, *(h for h in pool if h is not than and h.believable)]
        scores = weigh(self.proposer.trials.problem, group)
        return None if scores.argmax() == 0 else group[int(scores.argmax())]

    def _next(self, current: Hypothesis) -> Hypothesis | None:
        proposer = self.proposer
        best = f"best so far {current.error**0.5:.2f} noise floors"
        if current.effects and (fewer := self.best(moves.drops(proposer, current), current)):
            return fewer
        room = left_to_gain(proposer.trials.problem, current) > LEAST_ASKED
        if room:
            self.report(f"trying one effect more ({best})")
        more = self._addition(current) if room else None
        if several := self.best(moves.usual(proposer, current), more or current):
            return several
        if more:
            return more
        if current.effects:
            self.report(f"trying others in the place of what was found ({best})")
            if other := self.best(moves.swaps(proposer, current), current):
                return other
        self.report(f"trying two effects more ({best})")
        return self._pair(current)

    def _pair(self, current: Hypothesis) -> Hypothesis | None:
        """Return the best pair of causes of those that add to the evidence by themselves.

        Each is weighed alone against the current hypothesis first: one that explains another joint
        must not say how many samples are independent at this one.
        """
        pairs = moves.pairs(self.proposer, current)
        return self.best([h for h in pairs if self.best([h], current)], current) if pairs else None

    def _addition(self, current: Hypothesis) -> Hypothesis | None:
        """Return the best hypothesis with a cause more, none of those that are left out.

        What explains much by impossible numbers hides what explains less: it is put aside.
        """
        exclude: list[Key] = []
        for _ in range(_MASKS + 1):
            longer = moves.additions(self.proposer, current, exclude)
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


def best_of(search: Search, hypotheses: Sequence[Hypothesis]) -> Hypothesis:
    """Return the hypothesis with the most evidence of some."""
    scores = weigh(search.proposer.trials.problem, hypotheses)
    return hypotheses[int(scores.argmax())]
