"""Choosing the causes: add what pays on held-out data, drop what does not, prefer the simple."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.identification.choice.credibility import credible, pushes_out, showing
from wbc.identification.choice.drive_order import in_best_order, placed_first
from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.unexplained import unexplained
from wbc.identification.model.problem import ONLY_NOISE
from wbc.robot import Effect

_MOST_CAUSES = 8
_FEW_BLOCKS = 12  # in which a cause may gain much and still not be significant
_MASKING = 0.8  # of the error, below which a cause that is not believed may hide others
_COMPARABLE = 0.5  # of the gain of what is not believed, that what takes its place must have
_MASKS = 2  # times that such causes are put aside
_LITTLE = 0.1  # of the error (rms), that a step of a series takes away at most ...
_SERIES = 2  # ... so many times in a row, with much left
_HIDDEN = 0.5  # of the error, that two causes which hide one another must leave at most
_ON_CREDIT = 3  # causes that may be added before they pay together
REFINED = 6
_TIED = 0.05  # of the gain, by which the errors of equals may differ
SIMPLER = 0.05  # complexities closer than this are the same


@dataclass(frozen=True, eq=False)
class Selector(Proposer):
    """Greedy forward selection with refits, elimination and exchange.

    Attributes:
        problem: the logs.
        candidates: effect classes that may be used.
        aside: (name, where) of causes that are not considered.
        report: called with a line of text as the work proceeds.
    """

    report: Callable[[str], None] = lambda line: None

    def run(self, start: Sequence[Model] = (), enough: float = 0.0) -> list[Model]:
        """Return the models from no cause to the chosen ones, each one cause larger.

        The search ends where it begins to write down a series, without the terms of that.

        Args:
            start: a path to continue.
            enough: mean square in floors below which nothing more is sought.
        """
        path = list(start) or [self.model(())]
        first = path[0]
        while len(path) <= _MOST_CAUSES and self.hopeful(path[-1], first):
            if path[-1].error < enough:
                break
            if self._ends_in_a_series(path):
                return path[:-_SERIES]
            last = path[-1]
            best = self.best_addition(last, first) or self.before_a_drive(last, first)
            best = best or self.two_at_once(last, first) or self.on_credit(last, first)
            if best is None:
                break
            known = {e.key for e in last.effects}
            for effect in (e for e in best.effects if e.key not in known):
                self.report(f"{effect.name} at {effect.where}")
            path.append(in_best_order(best, self.model))
        return path

    def _ends_in_a_series(self, path: Sequence[Model]) -> bool:
        """Whether the last steps gained little and much is left: they write down something else."""
        last = path[-_SERIES - 1 :]
        little = all(
            after.error > (1.0 - _LITTLE) ** 2 * before.error
            for before, after in itertools.pairwise(last)
        )
        return len(last) > _SERIES and little and unexplained(self.problem, path[0].error, path[-1])

    def before_a_drive(self, model: Model, first: Model) -> Model | None:
        """Return the best model with one cause more that acts before another in a drive, or None.

        Screens see causes only as the last to act.
        """
        offers = placed_first(model, self.candidates, self.problem.robot)
        taken = [m for m in map(self.model, offers) if self.worthwhile(model, m, first)]
        shown = [m for m in taken if len(showing(self.problem, m.fit)) == len(m.effects)]
        return min(shown, key=lambda m: m.error, default=None)

    def two_at_once(self, model: Model, first: Model) -> Model | None:
        """Return the best model with two causes more of which none pays alone, or None.

        They hide one another: damping makes a delay look negative, and neither is possible alone.
        """
        if model.swings or not unexplained(self.problem, first.error, model):
            return None
        most = _HIDDEN * model.error
        trials = map(self.model, self.in_pairs(model, REFINED, most))
        taken = [m for m in trials if m.error < most and self.worthwhile(model, m, first)]
        whole = [m for m in taken if self.prune(m, first) is m]
        return min(whole, key=lambda m: m.error, default=None)

    def on_credit(self, model: Model, first: Model) -> Model | None:
        """Return the first model that pays with several causes more, or None.

        Of several large causes none may pay alone, since what the others leave hides its gain in
        the few blocks of a short log. Beside a link that is simulated there is no credit: what
        the simulation is off by looks like many causes.
        """
        few = np.unique(self.problem.blocks).size < _FEW_BLOCKS
        if not few or model.swings:
            return None
        current = model
        for _ in range(_ON_CREDIT):
            if current.error < ONLY_NOISE:
                return None
            larger = [m for m in self._trials(current) if m.error < current.error]
            if not larger:
                return None
            current = min(larger, key=lambda m: m.error)
            several = len(current.effects) > len(model.effects) + 1
            if several and self.worthwhile(model, current, first):
                kept = self.prune(current, first)
                if len(kept.effects) > len(model.effects) and self.worthwhile(model, kept, first):
                    return kept
        return None

    def best_addition(self, model: Model, first: Model, most: float = np.inf) -> Model | None:
        """Return the simplest of the models with one cause more that do best, or None.

        Nothing is fitted whose screened error is above `most`; `first` is without causes.
        """
        aside: list[tuple[str, str]] = []
        for _ in range(_MASKS + 1):
            trials = self._trials(model, most, aside)
            taken = [m for m in trials if self.worthwhile(model, m, first)]
            if taken or not (masks := _masking(trials, model)):
                break
            aside += masks
        if not taken:
            return None
        taken = self._believed_first(taken, model)
        lowest = min(taken, key=lambda m: m.error)
        close = [m for m in taken if not self.pays(m, lowest, first)]
        best = min(close, key=lambda m: (round(m.complexity, 6), m.numbers, self._rank(m)))
        # Where one shows that something is missing, an equal that leaves clearly less need not.
        clearly = best.error - _TIED * (model.error - best.error)
        rivals = [m for m in trials if m.error < clearly and credible(self.problem, m.fit)]
        equals = [m for m in rivals if m.complexity < best.complexity + SIMPLER]
        return min(equals, key=lambda m: m.error, default=best)

    def _believed_first(self, larger: list[Model], model: Model) -> list[Model]:
        """Return the models whose new numbers stay inside their range, if they gain comparably."""
        gain = model.error - min(m.error for m in larger)
        near = [m for m in larger if model.error - m.error > _COMPARABLE * gain]
        inside = [m for m in near if not pushes_out(self.problem, m.fit)]
        return inside or larger

    def _trials(
        self, model: Model, most: float = np.inf, exclude: Sequence[tuple[str, str]] = ()
    ) -> list[Model]:
        """Return the most promising models with more causes, all of which show.

        What explains most and does not show, or by impossible numbers, hides what explains less:
        it is put aside.
        """
        aside = list(exclude)
        least = 0.0
        for _ in range(_MASKS + 1):
            offers = self.promising(model, REFINED, aside, most=most)
            fitted = [self.model(effects) for effects in offers]
            shown = [self.shown(m, model) for m in fitted]
            shown = [m for m in shown if len(m.effects) > len(model.effects)]
            shown = [m for m in shown if model.error - m.error >= least]
            masks = _masking(fitted, model)
            if not masks or any(credible(self.problem, m.fit) for m in shown):
                return shown
            aside += masks
            # What shows by impossible numbers is not hidden by what explains far less.
            least = max([least, *(_COMPARABLE * (model.error - m.error) for m in shown)])
        return []

    def shown(self, model: Model, smaller: Model) -> Model:
        """Return `model` without those of the causes added to `smaller` that do not show."""
        seen = showing(self.problem, model.fit)
        kept = [e for k, e in enumerate(model.effects) if k < len(smaller.effects) or k in seen]
        return model if len(kept) == len(model.effects) else self.model(kept)

    def _rank(self, model: Model) -> int:
        """Return the place of the last cause in the list of candidates, for ties."""
        names = [effect.name for effect in self.candidates]
        return names.index(model.effects[-1].name)

    def prune(self, model: Model, first: Model) -> Model:
        """Return the model without causes that do not pay any more.

        What several of them explain together must not be lost by dropping one after the other, nor
        an explanation be given up for what explains too little.
        """
        current = model
        while current.effects:
            smaller = [self.model(without(current.effects, k)) for k in range(len(current.effects))]
            idle = [
                m
                for m in smaller
                if not self.pays(m, current, first) and not self.pays(m, model, first)
            ]
            if credible(self.problem, current.fit):
                idle = [m for m in idle if credible(self.problem, m.fit)]
            if not unexplained(self.problem, first.error, current):
                idle = [m for m in idle if not unexplained(self.problem, first.error, m)]
            if not idle:
                return current
            current = min(idle, key=lambda m: m.error)
        return current


def _masking(larger: Sequence[Model], model: Model) -> list[tuple[str, str]]:
    """Return (name, where) of what explains so much more than `model` that it may hide others."""
    masks = (m for m in larger if m.error < _MASKING * model.error)
    return [e.key for m in masks for e in m.effects[len(model.effects) :]]


def without(effects: Sequence[Effect], k: int) -> tuple[Effect, ...]:
    """Return the effects but number `k`."""
    return (*effects[:k], *effects[k + 1 :])
