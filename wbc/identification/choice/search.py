"""The search for causes: single moves from one hypothesis to the next while the evidence grows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from wbc.identification.choice.certainty import TIED
from wbc.identification.choice.drop_screen import losses
from wbc.identification.choice.evidence import (
    LEAST_ASKED,
    Hypothesis,
    Offer,
    left_to_gain,
    weigh,
    without,
)
from wbc.identification.choice.plain_models import plain_fits
from wbc.identification.choice.proposals import MISSED, Proposer

_ADDED = 6  # offers that are fitted for one addition, of one cause or two
_SWAPPED = 5  # ... that are looked at in the place of one cause
_MOST_MOVES = 60


def _drops(proposer: Proposer, h: Hypothesis) -> Iterator[Hypothesis]:
    """Yield hypotheses without a cause, or without all that say too little.

    Those alone are fitted of which the derivatives say that they may win, the most likely first.
    """
    trials = proposer.trials
    single: list[Offer] = [(effect,) for effect in h.effects]
    sudden = [own for own in single if not own[0].search.gradual]  # fits tell
    offers = [own for own in single if own not in sudden]
    fit = trials.fit(h)
    each = dict(zip(offers, losses(trials.problem, fit, h, offers), strict=True))
    idle = tuple(own[0] for own in single if own in each and each[own][0] < each[own][1])
    if len(idle) > 1:
        each[idle] = losses(trials.problem, fit, h, [idle])[0]
    likely = [own for own, (loss, gain) in each.items() if loss < MISSED * gain]
    likely.sort(key=lambda own: each[own][0] - each[own][1])
    for own in (*likely, *sudden):
        yield from trials.rivals_of(h, [without(h.effects, *own)])


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
        for _ in range(_MOST_MOVES):
            better = self._next(current)
            if better is None:
                break
            self._tell(current, better)
            if frozenset(better.keys) in been:
                return self.proposer.trials.best_of(list(been.values()))
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
        proposer, trials = self.proposer, self.proposer.trials
        best = f"best so far {current.error**0.5:.2f} noise floors"
        for fewer in _drops(proposer, current) if current.effects else ():
            if shorter := self.best([fewer], current):
                return shorter
        room = left_to_gain(trials.problem, current) > LEAST_ASKED
        if room:
            self.report(f"trying one effect more ({best})")
        more = self._addition(current) if room else None
        if not current.effects:
            # What the joints of machines usually have, all at once: found one by one they take a
            # move each, and at every move what is still missing is imitated.
            usual = plain_fits(trials, proposer.candidates, links=False)
            if several := self.best(usual, more or current):
                return several
        if more:
            return more
        if current.effects:
            self.report(f"trying others in the place of what was found ({best})")
            for offer in proposer.exchanges(current, _SWAPPED):
                exchanged = self.best(trials.rivals_of(current, [offer]), current)
                # What is not told apart is an alternative. It led to and fro between two frictions.
                if exchanged and np.ptp(weigh(trials.problem, [current, exchanged])) > TIED:
                    return exchanged
        self.report(f"trying two effects more ({best})")
        return self._pair(current)

    def _pair(self, current: Hypothesis) -> Hypothesis | None:
        """Return the best pair of causes of those that add to the evidence by themselves.

        They may hide one another. Each is weighed alone against the current hypothesis first: one
        that explains another joint must not say how many samples are independent at this one.
        """
        if current.swings:
            return None
        offers = self.proposer.pairs_beside(current, _ADDED)
        pairs = [self.best([h], current) for h in self.proposer.trials.rivals_of(current, offers)]
        return self.best([h for h in pairs if h is not None], current)

    def _addition(self, current: Hypothesis) -> Hypothesis | None:
        """Return the best hypothesis with a cause more, at one place or in all gears.

        What no machine is likely to have at one joint must not hide what is there at others.
        """
        trials = self.proposer.trials
        longer = trials.rivals_of(current, self.proposer.beside(current, _ADDED))
        several = [h for h in longer if not h.believable]
        likely = [h.likely for h in several if len(h.likely) > len(current.effects)]
        return self.best([*longer, *trials.rivals_of(current, likely)], current)

    def _tell(self, before: Hypothesis, after: Hypothesis) -> None:
        added = [
            f"+ {name} at {where}" for name, where in after.keys if (name, where) not in before.keys
        ]
        gone = [
            f"- {name} at {where}" for name, where in before.keys if (name, where) not in after.keys
        ]
        self.report(f"{', '.join(added + gone)}: {after.error**0.5:.2f} noise floors")
