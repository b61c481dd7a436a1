"""Which causes explain a residual: columns beside a fit, judged by held-out error, best first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from heapq import heappop, heappush

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.choice.candidate_columns import Regressor, evidence, make_regressors
from wbc.identification.choice.design_matrix import Beside, DesignMatrix, fold_sums
from wbc.identification.choice.evidence import Key
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import evaluate
from wbc.robot import Effect, Evidence, Robot

_COLUMNS = 4  # pairs of columns per pair of causes, at most
_ROUNDING = 1.0 - 1e-6  # by which a bound is lowered


@dataclass(frozen=True)
class Subset:
    """A set of regressors with its held-out error.

    Attributes:
        regressors: numbers of the regressors, in the order added.
        error: held-out mean square of the whitened residual.
    """

    regressors: tuple[int, ...]
    error: float


class LinearScreen:
    """The columns of every cause beside a fit: what each would leave on data held out."""

    def __init__(
        self,
        fit: Fit,
        regressors: Sequence[Regressor],
        whitening: FloatArray,
        folds: IntArray,
        noise: float = 1.0,
    ) -> None:
        """Sum up the columns of all regressors.

        Args:
            fit: the model that causes are added to; its own parameters stay free to move.
            regressors: candidates with columns (rows, outputs, r).
            whitening: (outputs, judged outputs) of the fit.
            folds: (rows,) numbers of the folds.
            noise: mean square of the fit's residual over independent samples per row, by which
                what is usual is weighed.
        """
        self.robot = fit.robot
        self.regressors = list(regressors)
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
        for regressor, places in zip(self.regressors, self._slices, strict=True):
            usual[0][np.ix_(places, places)] = noise * regressor.usual
        own = fit.usual.jacobian
        usual[0][np.ix_(self._nuisance, self._nuisance)] = noise * own.T @ own
        usual[1][self._nuisance] = -noise * own.T @ fit.usual.residual
        columns = [regressor.columns for regressor in self.regressors]
        sums = fold_sums(columns, -fit.jacobian, fit.residual, whitening, folds)
        self.matrix = DesignMatrix(*sums, expected, usual)
        self._beside = Beside(self.matrix, self._nuisance)
        self._errors: dict[tuple[int, ...], float] = {}
        self._taken: frozenset[Key] = frozenset()

    def instead_of(
        self, gone: Sequence[int], steps: FloatArray, robot: Robot, taken: Collection[Key]
    ) -> LinearScreen:
        """Return the search beside the fit without some of its causes, to first order.

        Args:
            gone: numbers of their parameters among those of the fit.
            steps: by which these change until the causes are not there, in their scales.
            robot: without the causes.
            taken: names and places that are not offered.
        """
        other = copy(self)
        other.robot = robot
        if gone:
            columns = [self._nuisance[k] for k in gone]
            other._nuisance = [column for column in self._nuisance if column not in columns]
            other.matrix = self.matrix.moved(columns, steps)
            other._beside = Beside(other.matrix, other._nuisance)
        other._errors = {}
        other._taken = frozenset(taken)
        return other

    def columns(self, chosen: Sequence[int]) -> list[int]:
        """Return the column numbers of these regressors."""
        return [column for k in chosen for column in self._slices[k]]

    def error(self, chosen: Sequence[int]) -> float:
        """Return the held-out error of a set; infinite if its parameters are impossible."""
        key = tuple(sorted(chosen))
        if key not in self._errors:
            allowed = not key or self._possible(key)
            self._errors[key] = (
                self._beside.held_out(self.columns(key)) if allowed else float("inf")
            )
        return self._errors[key]

    def coefficients(self, chosen: Sequence[int]) -> list[FloatArray]:
        """Return the coefficients of each regressor of a set."""
        all_of_them = self._beside.fit(self.columns(chosen))
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

    def best_first(self) -> Iterator[Subset]:
        """Yield every possible cause, that which leaves least on data held out first.

        A cause is an effect at one place, or the same effect in all gears. What a cause leaves
        where it is fitted is never more than what it leaves on data held out: a cause is judged
        only when nothing that was judged before leaves less than that bound.
        """
        free = [k for k, own in enumerate(self.regressors) if own.key not in self._taken]
        singles = self.matrix.least_errors([self._slices[k] for k in free], self._nuisance)
        bounds = dict(zip(free, singles.tolist(), strict=True))
        everywhere = self._by_effect(free)
        unions = [[c for k in group for c in self._slices[k]] for group in everywhere]
        groups = self.matrix.least_errors(unions, self._nuisance)
        # (error, order, judged): a bound comes before what is judged to leave the same.
        queue: list[tuple[float, int, tuple[int, ...]]] = []
        for order, bound in enumerate([*singles, *groups]):
            heappush(queue, (float(bound) * _ROUNDING, order, ()))
        while queue:
            error, order, judged = heappop(queue)
            if judged:
                yield Subset(judged, error)
                continue
            if order < len(free):
                chosen = [free[order]]
            else:
                chosen = self._best_shapes(everywhere[order - len(free)], bounds)
            error = self.error(chosen) if chosen else float("inf")
            if np.isfinite(error):
                heappush(queue, (error, order, tuple(chosen)))

    def pairs(self, among: int) -> list[Subset]:
        """Return the best sets of two causes, of the `among` that explain most but for chance.

        Alone such causes may explain nothing, or be impossible: damping hides a delay.
        """
        owner = np.repeat(np.arange(len(self.regressors)), [len(own) for own in self._slices])
        gains = np.triu(self._beside.gains_of_two(owner.size), 1)
        tried: dict[tuple[int, ...], None] = {}
        for flat in np.argsort(gains, axis=None)[::-1][: _COLUMNS * among]:
            one, other = (int(owner[k]) for k in divmod(int(flat), owner.size))
            if self.regressors[one].key != self.regressors[other].key:
                tried[one, other] = None
        found = [Subset(chosen, self.error(chosen)) for chosen in list(tried)[:among]]
        return sorted(found, key=lambda s: s.error)

    def _by_effect(self, free: Sequence[int]) -> list[list[int]]:
        """Return the regressors of every effect that could be in several gears alike.

        One cause in all gears is a simpler story than two different ones.
        """
        joints = self.robot.transmission.joints
        groups: dict[tuple[str, int], list[int]] = {}
        for k in free:
            own = self.regressors[k]
            if own.where in joints:
                groups.setdefault((own.effect.name, own.size), []).append(k)
        places = [{self.regressors[k].where for k in group} for group in groups.values()]
        return [g for g, where in zip(groups.values(), places, strict=True) if len(where) > 1]

    def _best_shapes(self, group: Sequence[int], bounds: Mapping[int, float]) -> list[int]:
        """Return an effect in its best shape at every joint it can be at; empty if at most one.

        Args:
            group: regressors of the effect.
            bounds: below what each leaves: a shape is judged only where it may be the best.
        """
        best: dict[str, int] = {}
        for k in sorted(group, key=lambda k: bounds[k]):
            where = self.regressors[k].where
            least = self.error((best[where],)) if where in best else np.inf
            if bounds[k] * _ROUNDING < least and self.error((k,)) < least:
                best[where] = k
        shapes = sorted(best.values(), key=lambda k: self.error((k,)))
        possible = self._without_impossible(shapes)
        return possible if len(possible) > 1 else []

    def _without_impossible(self, group: list[int]) -> list[int]:
        """Return the members that are possible together: friction may not push."""
        while len(group) > 1 and not np.isfinite(self.error(group)):
            pairs = zip(group, self.coefficients(group), strict=True)
            kept = [k for k, c in pairs if self.regressors[k].build(self.robot, c) is not None]
            if len(kept) == len(group):
                break
            group = kept
        return group


_WHOLE = "robot"  # where effects sit that have no place


def screen(
    problem: EstimationProblem,
    fit: Fit,
    offered: Sequence[type[Effect]],
    failures: Counter[str] | None = None,
) -> LinearScreen:
    """Return the search over what could be added to a model or stand in the place of its causes.

    The present parameters are free to move. One set of columns serves for the place of every cause:
    what a small effect adds hardly depends on one cause more or less. Shapes that follow the data
    are those that show with all causes, and at the place of each cause those that show without it.

    Args:
        problem: the logs.
        fit: the model.
        offered: effect classes that act at once.
        failures: errors inside effects are counted there.
    """
    at = evaluate(problem.robot, fit.effects, problem.records, problem.whitening)
    shown: list[tuple[Evidence, list[str] | None]] = [(evidence(fit.robot, problem.records), None)]
    for gone in () if fit.swings else fit.effects:  # links that swing would be simulated for each
        rest = problem.robot.with_effects(*(e for e in fit.effects if e is not gone))
        shown.append((evidence(rest, problem.records), [gone.where]))
    regressors = make_regressors(problem.columns, at, offered, shown, failures, problem.still)
    # Those that an output which is judged feels.
    felt = [r for r in regressors if problem.whitening[r.columns.outputs].any()]
    kept = [regressor for regressor in felt if not _drawn_twice(fit, regressor)]
    kept.sort(key=lambda regressor: offered.index(regressor.effect))
    noise = float(np.min(problem.row_noise(fit.residual)))  # of the output that says most
    return LinearScreen(fit, kept, problem.whitening, problem.folds, noise)


def screen_in_shares(
    problem: EstimationProblem, fit: Fit, regressors: Sequence[Regressor], share: FloatArray
) -> LinearScreen:
    """Return a search in which every output counts in a unit of its own.

    Args:
        problem: the logs.
        fit: the model that causes are added to.
        regressors: the causes.
        share: (judged outputs,) what one floor of each output counts.
    """
    scaled = replace(fit, residual=fit.residual * share, jacobian=fit.jacobian * share[:, None])
    noise = float(np.min(problem.row_noise(fit.residual) * share**2))
    whitening = problem.whitening * share
    return LinearScreen(scaled, regressors, whitening, problem.folds, noise)


def _drawn_twice(fit: Fit, regressor: Regressor) -> bool:
    """Whether a drawing would be wrong once as a whole and once in one of its links."""
    places = {effect.where for effect in fit.effects if effect.search.departures(effect).size}
    return bool(places and regressor.usual.any()) and _WHOLE in {*places, regressor.where}
