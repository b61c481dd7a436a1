"""Which sets of causes explain a residual: a beam search over held-out error."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.choice.screening.candidate_columns import Regressor
from wbc.identification.choice.screening.design_matrix import DesignMatrix
from wbc.identification.choice.weighing.hypothesis import Key
from wbc.identification.model.fit import Fit
from wbc.robot import Effect, Robot

# Rows are five per period of the band: half of them hold all that a screen, which only proposes,
# needs to know. Scores made with it stand in corpus_results.md (seed 34): as many right as before.
_EVERY = 2
_COLUMNS = 4  # pairs of columns per pair of causes, at most


@dataclass(frozen=True)
class Subset:
    """A set of regressors with its held-out error.

    Attributes:
        regressors: numbers of the regressors, in the order added.
        error: held-out mean square of the whitened residual.
    """

    regressors: tuple[int, ...]
    error: float


class BeamSearch:
    """Forward selection that keeps several sets per size and adds places or whole effects."""

    def __init__(
        self,
        fit: Fit,
        regressors: Sequence[Regressor],
        whitening: FloatArray,
        folds: IntArray,
        width: int = 8,
        noise: float = 1.0,
    ) -> None:
        """Sum up the columns of all regressors.

        Args:
            fit: the model that causes are added to; its own parameters stay free to move.
            regressors: candidates with columns (rows, outputs, r).
            whitening: (outputs, judged outputs) of the fit.
            folds: (rows,) numbers of the folds.
            width: sets kept per size.
            noise: mean square of the fit's residual over independent samples per row, by which
                what is usual is weighed.
        """
        self.robot = fit.robot
        self.regressors = list(regressors)
        self.width = width
        ends = np.cumsum([regressor.size for regressor in self.regressors])
        self._slices = [
            list(range(end - regressor.size, end))
            for regressor, end in zip(self.regressors, ends, strict=True)
        ]
        first = int(ends[-1]) if self.regressors else 0
        self._nuisance = list(range(first, first + fit.jacobian.shape[-1]))
        expected = np.zeros(first + fit.jacobian.shape[-1])
        for regressor, places in zip(self.regressors, self._slices, strict=True):
            expected[places] = regressor.screen.expected
        usual = np.zeros((expected.size, expected.size)), np.zeros(expected.size)
        noise = noise / _EVERY
        for regressor, places in zip(self.regressors, self._slices, strict=True):
            usual[0][np.ix_(places, places)] = noise * regressor.usual
        own = fit.usual.jacobian
        usual[0][np.ix_(self._nuisance, self._nuisance)] = noise * own.T @ own
        usual[1][self._nuisance] = -noise * own.T @ fit.usual.residual
        parts = self._by_folds(fit, whitening, folds)
        self.matrix = DesignMatrix.from_folds(parts, expected, usual)
        self._errors: dict[tuple[int, ...], float] = {}
        self._taken: frozenset[Key] = frozenset()

    def _by_folds(
        self, fit: Fit, whitening: FloatArray, folds: IntArray
    ) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield columns (outputs, rows, c) and residual (outputs, rows) of each fold, whitened."""
        outputs, first = fit.residual.shape[1], sum(map(len, self._slices))
        for fold in np.unique(folds):
            rows = np.flatnonzero(folds == fold)[::_EVERY]
            columns = np.zeros((outputs, rows.size, first + len(self._nuisance)))
            columns[:, :, first:] = -np.moveaxis(fit.jacobian[rows], 1, 0)
            for regressor, places in zip(self.regressors, self._slices, strict=True):
                own, place = regressor.columns, slice(places[0], places[-1] + 1)
                for k, output in enumerate(own.outputs):
                    values = own.values[rows, k]
                    for judged in np.flatnonzero(whitening[output]):
                        columns[judged, :, place] += whitening[output, judged] * values
            yield columns, fit.residual[rows].T

    def instead_of(
        self, gone: Sequence[int], steps: FloatArray, robot: Robot, taken: Collection[Key]
    ) -> BeamSearch:
        """Return the search beside the fit without some of its causes, to first order.

        Args:
            gone: numbers of their parameters among those of the fit.
            steps: by which these change until the causes are not there, in their scales.
            robot: without the causes.
            taken: names and places that are not offered.
        """
        columns = [self._nuisance[k] for k in gone]
        other = copy(self)
        other.robot = robot
        other._nuisance = [column for column in self._nuisance if column not in columns]
        other.matrix = self.matrix.moved(columns, steps)
        other._errors = {}
        other._taken = frozenset(taken)
        return other

    def columns(self, chosen: Sequence[int]) -> list[int]:
        """Return the column numbers of these regressors."""
        return [column for k in chosen for column in self._slices[k]] + self._nuisance

    def error(self, chosen: Sequence[int]) -> float:
        """Return the held-out error of a set; infinite if its parameters are impossible."""
        key = tuple(sorted(chosen))
        if key not in self._errors:
            allowed = not key or self._possible(key)
            self._errors[key] = self.matrix.held_out(self.columns(key)) if allowed else float("inf")
        return self._errors[key]

    def coefficients(self, chosen: Sequence[int]) -> list[FloatArray]:
        """Return the coefficients of each regressor of a set."""
        all_of_them = self.matrix.fit(self.columns(chosen))
        result, start = [], 0
        for k in chosen:
            size = len(self._slices[k])
            result.append(all_of_them[start : start + size])
            start += size
        return result

    def effects(self, subset: Subset) -> tuple[Effect, ...]:
        """Return the effects of a set, with the numbers that the screen gives them."""
        pairs = zip(subset.regressors, self.coefficients(subset.regressors), strict=True)
        built = [self.regressors[k].build(self.robot, c) for k, c in pairs]
        return tuple(effect for effect in built if effect is not None)

    def _possible(self, chosen: Sequence[int]) -> bool:
        pairs = zip(chosen, self.coefficients(chosen), strict=True)
        return all(self.regressors[k].build(self.robot, c) is not None for k, c in pairs)

    def grow(self, starts: Sequence[Subset]) -> list[Subset]:
        """Return the best sets that have one cause more than one of `starts`.

        A cause is an effect at one place, or the same effect in all gears.
        """
        found: dict[tuple[int, ...], Subset] = {}
        for start in starts:
            for addition in self._additions(start.regressors):
                chosen = (*start.regressors, *addition)
                key = tuple(sorted(chosen))
                if key not in found:
                    error = self.error(key)
                    if np.isfinite(error):
                        found[key] = Subset(chosen, error)
        return sorted(found.values(), key=lambda s: s.error)[: self.width]

    def pairs(self, among: int) -> list[Subset]:
        """Return the best sets of two causes, of the `among` that explain most but for chance.

        Alone such causes may explain nothing, or be impossible: damping hides a delay.
        """
        owner = np.repeat(np.arange(len(self.regressors)), [len(own) for own in self._slices])
        gains = np.triu(self.matrix.gains_of_two(self._nuisance), 1)
        tried: dict[tuple[int, ...], None] = {}
        for flat in np.argsort(gains, axis=None)[::-1][: _COLUMNS * among]:
            one, other = (int(owner[k]) for k in divmod(int(flat), owner.size))
            if self.regressors[one].key != self.regressors[other].key:
                tried[one, other] = None
        found = [Subset(chosen, self.error(chosen)) for chosen in list(tried)[:among]]
        return sorted(found, key=lambda s: s.error)[: self.width]

    def _additions(self, chosen: Sequence[int]) -> list[tuple[int, ...]]:
        taken = {self.regressors[k].key for k in chosen} | self._taken
        single = [k for k, regressor in enumerate(self.regressors) if regressor.key not in taken]
        return [*((k,) for k in single), *self._shared(single)]

    def _shared(self, free: Sequence[int]) -> list[tuple[int, ...]]:
        """Return every effect of the gears at all of its free joints, in its best shape at each.

        One cause in all gears is a simpler story than two different ones.
        """
        joints = self.robot.transmission.joints
        best: dict[tuple[str, int], dict[str, int]] = {}
        for k in free:
            regressor = self.regressors[k]
            if regressor.where not in joints or not np.isfinite(self.error((k,))):
                continue
            places = best.setdefault((regressor.effect.name, regressor.size), {})
            known = places.get(regressor.where)
            if known is None or self.error((k,)) < self.error((known,)):
                places[regressor.where] = k
        groups = [
            sorted(places.values(), key=lambda k: self.error((k,))) for places in best.values()
        ]
        possible = [self._without_impossible(group) for group in groups]
        return [tuple(group) for group in possible if len(group) > 1]

    def _without_impossible(self, group: list[int]) -> list[int]:
        """Return the members that are possible together: friction may not push."""
        while len(group) > 1 and not np.isfinite(self.error(group)):
            pairs = zip(group, self.coefficients(group), strict=True)
            kept = [k for k, c in pairs if self.regressors[k].build(self.robot, c) is not None]
            if len(kept) == len(group):
                break
            group = kept
        return group
