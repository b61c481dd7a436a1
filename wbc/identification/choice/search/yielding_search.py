"""The search for links that swing behind soft or loose gears: each trial is a simulation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from wbc.identification.choice.gears.pairs import best_pairs, loose_beside, loudest
from wbc.identification.choice.gears.pattern_search import FAR, NEAR, pattern_search
from wbc.identification.choice.search.proposals import Proposer
from wbc.identification.choice.search.search import Search
from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.identification.model.estimation_problem import ONLY_NOISE

_ADDED = 6  # offers that are fitted for one addition
_ROUNDS = 3  # in which numbers of gears that strike are tried one by one ...
_CALMER = 0.8  # ... as long as so little of the error is left
_SIMULATED = 0.04  # share of the first error to which links behind soft gears are simulated
_PAIRED = 0.8  # of the error, that two gears from a coarse grid must leave at most


@dataclass(eq=False)
class YieldingSearch:
    """Adds gears that yield to hypotheses.

    Attributes:
        search: among all causes.
    """

    search: Search

    @property
    def _proposer(self) -> Proposer:
        return self.search.proposer

    @cached_property
    def _gears(self) -> Proposer:
        return self._proposer.yielding

    @property
    def rough(self) -> float:
        """Error up to which a log counts as explained as far as simulated links go."""
        return ONLY_NOISE + _SIMULATED**2 * self._proposer.trials.nothing.error

    def swung(self, origin: Hypothesis) -> Hypothesis:
        """Return a hypothesis with links that swing, as many as add to the evidence."""
        current = origin
        while (longer := self._longer(current)) is not None:
            self.search.report(
                f"{longer.effects[-1].name} at {longer.effects[-1].where}: "
                f"{longer.error**0.5:.2f} noise floors"
            )
            current = longer
        return current

    def _longer(self, h: Hypothesis) -> Hypothesis | None:
        trials = self._proposer.trials
        if h.bounces:
            # A loose gear found alone holds in its numbers what another one does.
            both = self.pair_beside(h) if len(h.effects) == 1 else None
            return self.search.best([both], h) if both is not None else None
        best = self.search.best(trials.all_of(self._gears.beside(h, _ADDED)), h)
        # Numbers of loose gears are tried one by one: for the best alone, each is a simulation.
        return self._settled(best) if best is not None and best.bounces else best

    def loose_beside(self, soft: Hypothesis) -> Hypothesis | None:
        """Return a hypothesis with springs and a loose gear more, None if it adds no evidence."""
        trials = self._proposer.trials
        offers = loose_beside(trials.problem, soft.effects, self._gears.candidates)
        best = self.search.best(trials.all_of(offers), soft)
        return None if best is None else self._settled(best)

    def pair_beside(self, known: Hypothesis) -> Hypothesis | None:
        """Return two gears that yield at once, with numbers settled, if they promise more.

        Args:
            known: what must be left behind before the numbers are worth settling.
        """
        both = self._pair
        if both is None or both.error > known.error:
            return None
        return self._settled(both)

    @cached_property
    def _pair(self) -> Hypothesis | None:
        """The two gears that explain most together, at least one of them loose; None if little."""
        trials = self._proposer.trials
        problem = trials.problem
        pairs, logs = best_pairs(problem, self._gears.candidates), loudest(problem)
        begun = [pair.effects for pair in pairs if pair.share < _PAIRED]
        tried = [pattern_search(problem, effects, FAR, logs)[0] for effects in begun]
        return self.search.best(trials.all_of(tried), trials.nothing)

    def _settled(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis with better numbers of its loose gears, where there are."""
        trials = self._proposer.trials
        for _ in range(_ROUNDS):
            effects, _ = pattern_search(trials.problem, h.effects, NEAR, trials.problem.records)
            other = trials.of(effects)
            if other is None or other.error > _CALMER * h.error:
                return h if other is None or other.error > h.error else other
            h = other
        return h
