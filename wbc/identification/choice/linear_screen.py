"""Which causes explain a residual: columns beside a fit, judged by held-out error, best first.

Everything is read off normal equations per fold. Noise is correlated between outputs, so that a
whitened column differs from zero at most outputs; as it is, a column mostly does so at one. Its
products are summed as it is: with W what whitens,

    sum over rows of (A W)' (A W) = sum over outputs o, p of (W W')_op A_o' A_p.

Columns that many outputs feel are whitened first: that is fewer products.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import compress, pairwise
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.choice.candidate_columns import Regressor, evidence, make_regressors
from wbc.identification.choice.evidence import Key
from wbc.identification.model.columns import SparseColumns, drawn
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import evaluate
from wbc.identification.records.record import rows_of_folds
from wbc.robot import Effect, Evidence, Robot

_RIDGE = 1e-10
_RIDGE_HELD_OUT = 1e-3
_ALIKE = 1e-6  # of squares, that two columns must differ by to be two
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


class FoldSums(NamedTuple):
    """What linear fits need to know of their rows, by fold."""

    gram: FloatArray
    """(K, c, c) products of columns."""
    moment: FloatArray
    """(K, c) of columns and residual."""
    energy: FloatArray
    """(K,) of the residual with itself."""
    entries: int
    """Of the residual."""

    def moved(self, chosen: IntArray, steps: FloatArray) -> FoldSums:
        """Return the same for a residual from which some columns times `steps` are taken."""
        along = self.gram[:, :, chosen] @ steps
        energy = self.energy - 2.0 * self.moment[:, chosen] @ steps + along[:, chosen] @ steps
        return self._replace(moment=self.moment - along, energy=energy)


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
        ends = np.cumsum([0, *(regressor.size for regressor in self.regressors)])
        self._slices = [list(range(*pair)) for pair in pairwise(ends.tolist())]
        self._nuisance = np.arange(ends[-1], ends[-1] + fit.jacobian.shape[-1])
        columns = [regressor.columns for regressor in self.regressors]
        self._sums = _fold_sums(columns, -fit.jacobian, fit.residual, whitening, folds)
        # What is known of the coefficients before, as normal equations, and where a fold alone
        # knows a column.
        size = self._sums.moment.shape[1]
        self._usual, self._pull, self._expected = np.zeros((size, size)), *np.zeros((2, size))
        for regressor, places in zip(self.regressors, self._slices, strict=True):
            self._usual[np.ix_(places, places)] = noise * regressor.usual
            self._expected[places] = regressor.screen.expected
        own = fit.usual.jacobian
        self._usual[np.ix_(self._nuisance, self._nuisance)] = noise * own.T @ own
        self._pull[self._nuisance] = -noise * own.T @ fit.usual.residual
        self._taken: frozenset[Key] = frozenset()
        self._let_others_take()

    def instead_of(
        self, gone: Sequence[int], steps: FloatArray, robot: Robot, taken: Collection[Key]
    ) -> LinearScreen:
        """Return the screen beside the fit without some of its causes, to first order.

        Args:
            gone: numbers of their parameters among those of the fit.
            steps: by which these change until the causes are not there, in their scales.
            robot: without the causes.
            taken: names and places that are not offered.
        """
        other = copy(self)
        other.robot, other._taken = robot, frozenset(taken)
        if gone:
            columns = self._nuisance[list(gone)]
            other._nuisance = np.setdiff1d(self._nuisance, columns)
            other._sums = self._sums.moved(columns, steps)
            other._let_others_take()
        return other

    def _let_others_take(self) -> None:
        """Eliminate the parameters of the fit, without each fold, and last on all folds.

        A set of causes then costs a system of its own size (Schur complement).
        """
        sums, others = self._sums, self._nuisance
        # A column that only the held-out fold knows must not be extrapolated from nothing.
        self._shrink = _RIDGE_HELD_OUT * np.einsum("kii->i", sums.gram)
        moment = sums.moment.sum(axis=0) + self._pull
        without = moment - sums.moment + self._shrink * self._expected
        self._right = np.concatenate([without, moment[None]])
        self._across = self._normal(others[:, None], np.arange(moment.size))
        both = np.concatenate([self._across, self._right[:, others, None]], axis=2)
        self._explained = _solve(self._across[:, :, others], both)
        # What each fold is left with, and its columns, once the others have taken theirs by what
        # all other folds say: moments, energy, and by how much products of columns change.
        taken, along = self._explained[:-1, :, :-1], self._explained[:-1, :, -1:]
        own, across = sums.gram[:, others[:, None], others], sums.gram[:, others]
        self._open = own @ taken - 2.0 * across
        left = sums.moment[:, others, None] - own @ along
        gone = across.swapaxes(1, 2) @ along + taken.swapaxes(1, 2) @ left
        self._held_moment = sums.moment - gone[..., 0]
        both = left + sums.moment[:, others, None]
        self._held_energy = float(sums.energy.sum() - np.sum(along * both))
        self._known: dict[tuple[int, ...], tuple[float, FloatArray]] = {}

    def _normal(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Return (K + 1, ...) entries of the normal matrices, whose numbers are broadcast."""
        gram = self._sums.gram[:, rows, columns]
        whole = gram.sum(axis=0) + self._usual[rows, columns]
        shrink = np.where(rows == columns, self._shrink[columns], 0.0)
        return np.concatenate([whole - gram + shrink, whole[None]])

    def _fits(self, own: IntArray) -> FloatArray:
        """Return the coefficients (K + 1, m, r) of m sets of columns (m, r)."""
        across, explained = self._across[..., own], self._explained[..., own]
        whole = self._normal(own[:, :, None], own[:, None])
        apart = whole - np.einsum("kpmr,kpms->kmrs", across, explained)
        beside = np.einsum("kpmr,kp->kmr", across, self._explained[..., -1])
        return _solve(apart, (self._right[:, own] - beside)[..., None], whole)[..., 0]

    def coefficients(self, chosen: Sequence[int]) -> list[FloatArray]:
        """Return the coefficients of each regressor of a set, on all folds."""
        ends = np.cumsum([self.regressors[k].size for k in chosen])
        return np.split(self._found(chosen)[1], ends[:-1])

    def error(self, chosen: Sequence[int]) -> float:
        """Return the held-out mean square of a set, whether or not its parameters are possible."""
        return self._found(chosen)[0]

    def _found(self, chosen: Sequence[int]) -> tuple[float, FloatArray]:
        """Return the held-out mean square of a set and the coefficients (r,) on all folds."""
        key = tuple(chosen)
        if key not in self._known:
            # All of one cause with as many columns cost little more than one of them.
            same = [key]
            if len(key) == 1:
                size = self.regressors[key[0]].size
                same = [(k,) for k, own in enumerate(self.regressors) if own.size == size]
            columns = [[column for k in own for column in self._slices[k]] for own in same]
            errors, found = self._held_out(np.array(columns, dtype=np.int_))
            pairs = zip(errors.tolist(), found, strict=True)
            self._known.update(zip(same, pairs, strict=True))
        return self._known[key]

    def _held_out(self, own: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return what m sets of columns (m, r) leave held out (m,), and coefficients (m, r)."""
        *each, whole = self._fits(own)
        found = np.array(each)
        taken, changed = self._explained[:-1, :, :-1][..., own], self._open[..., own]
        products = self._sums.gram[:, own[:, :, None], own[:, None]]
        products = products + np.einsum("kpmr,kpms->kmrs", taken, changed)
        model = np.einsum("kmr,kmrs,kms->m", found, products, found)
        along = np.einsum("kmr,kmr->m", found, self._held_moment[:, own])
        left = (self._held_energy - 2.0 * along + model) / self._sums.entries
        return np.asarray(left), whole

    def effects(self, subset: Subset) -> tuple[Effect, ...]:
        """Return the effects of a set, with the numbers that the screen gives them."""
        return tuple(effect for effect in self._built(subset.regressors) if effect is not None)

    def possible(self, chosen: Sequence[int]) -> bool:
        """Whether a robot can have the causes of a set with the numbers that the screen gives."""
        return None not in self._built(chosen)

    def _built(self, chosen: Sequence[int]) -> list[Effect | None]:
        pairs = zip(chosen, self.coefficients(chosen) if chosen else (), strict=True)
        return [self.regressors[k].build(self.robot, c) for k, c in pairs]

    def best_first(self) -> Iterator[Subset]:
        """Yield every possible cause, that which leaves least on data held out first.

        A cause is an effect at one place, or the same effect in all gears.
        """
        free = [k for k, own in enumerate(self.regressors) if own.key not in self._taken]
        causes = [[k] for k in free]
        causes += [self._best_shapes(group) for group in self._by_effect(free)]
        sets = [Subset(tuple(own), self.error(own)) for own in causes if own]
        yield from (s for s in sorted(sets, key=lambda s: s.error) if self.possible(s.regressors))

    def pairs(self, among: int) -> Iterator[Subset]:
        """Yield the best sets of two causes, of the `among` that explain most but for chance.

        Alone such causes may explain nothing, or be impossible: damping hides a delay.
        """
        owner = np.repeat(np.arange(len(self.regressors)), [len(own) for own in self._slices])
        gains = np.triu(self._gains_of_two(owner.size), 1)
        tried: dict[tuple[int, ...], None] = {}
        for flat in np.argsort(gains, axis=None)[::-1][: _COLUMNS * among]:
            one, other = (int(owner[k]) for k in divmod(int(flat), owner.size))
            if self.regressors[one].key != self.regressors[other].key:
                tried[one, other] = None
        found = [Subset(chosen, self.error(chosen)) for chosen in list(tried)[:among]]
        yield from (s for s in sorted(found, key=lambda s: s.error) if self.possible(s.regressors))

    def _gains_of_two(self, count: int) -> FloatArray:
        """Return (n, n) what every two of the first n columns explain, fitted to all folds."""
        own = np.arange(count)
        across, explained = self._across[-1][:, own].T, self._explained[-1]
        gram = self._normal(own[:, None], own)[-1] - across @ explained[:, own]
        moment = self._right[-1, own] - across @ explained[:, -1]
        size = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        along, shared = moment / size, gram / np.outer(size, size)
        apart = 1.0 - shared**2
        both = along[:, None] ** 2 + along**2 - 2.0 * shared * np.outer(along, along)
        clear = apart > _ALIKE
        single = np.maximum(along[:, None] ** 2, along**2)
        return np.asarray(np.where(clear, both / np.where(clear, apart, 1.0), single))

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
        return list(groups.values())

    def _best_shapes(self, group: Sequence[int]) -> list[int]:
        """Return an effect in its best shape at every joint it can be at; empty if at most one.

        Args:
            group: regressors of the effect.
        """
        best: dict[str, int] = {}
        for k in sorted(group, key=lambda k: self.error([k])):
            if self.regressors[k].where not in best and self.possible([k]):
                best[self.regressors[k].where] = k
        shapes = list(best.values())
        # Friction may not push: not all that is possible alone is so beside the others.
        while len(shapes) > 1 and None in (built := self._built(shapes)):
            shapes = [k for k, effect in zip(shapes, built, strict=True) if effect is not None]
        return shapes if len(shapes) > 1 else []


def _solve(gram: FloatArray, right: FloatArray, whole: FloatArray | None = None) -> FloatArray:
    """Solve normal equations after scaling the columns to one, with a tiny ridge.

    Args:
        gram: (..., n, n).
        right: (..., n, m).
        whole: (..., n, n) with what was eliminated, if anything was: what is left of a column that
            the others hold is rounding.
    """
    squares = np.diagonal(gram if whole is None else whole, axis1=-2, axis2=-1)
    size = np.sqrt(np.maximum(squares, 1e-300))[..., None]
    scaled = gram / size / size.swapaxes(-1, -2) + _RIDGE * np.eye(gram.shape[-1])
    return np.asarray(np.linalg.solve(scaled, right / size) / size)


def _fold_sums(
    columns: Sequence[SparseColumns],
    whitened: FloatArray,
    residual: FloatArray,
    whitening: FloatArray,
    folds: IntArray,
) -> FoldSums:
    """Return the sums of all columns, those that are not whitened yet first.

    Args:
        columns: (rows, outputs, r) each, not whitened.
        whitened: (rows, judged outputs, p) more columns.
        residual: (rows, judged outputs), whitened.
        whitening: (outputs, judged outputs).
        folds: (rows,) number of the fold of each row.
    """
    few = np.array([own.outputs.size**2 <= len(whitening) for own in columns], dtype=bool)
    sparse, dense = list(compress(columns, few)), list(compress(columns, ~few))
    sums = []
    for rows in rows_of_folds(folds):
        more = [own.at_rows(rows).whitened(whitening) for own in dense]
        beside = np.concatenate([*more, whitened[rows], residual[rows, :, None]], axis=2)
        sums.append(_products([own.at_rows(rows) for own in sparse], beside, whitening))
    # Sparse columns came first, then dense ones, then what was whitened before.
    late = np.repeat(~few, [own.values.shape[2] for own in columns])
    late = np.concatenate([late, np.ones(whitened.shape[2], dtype=bool)])
    place, whole = np.argsort(np.argsort(late, kind="stable")), np.array(sums)
    gram, moment = whole[:, place[:, None], place], whole[:, place, -1]
    return FoldSums(gram, moment, whole[:, -1, -1], residual.size)


def _products(
    sparse: Sequence[SparseColumns], beside: FloatArray, whitening: FloatArray
) -> FloatArray:
    """Return the products (c, c) of all columns, whitened.

    Args:
        sparse: (rows, outputs, r) each, not whitened.
        beside: (rows, judged outputs, q) more columns, whitened.
        whitening: (outputs, judged outputs).
    """
    # Of each column what single outputs feel, side by side.
    pairs = [(own.outputs, column) for own in sparse for column in np.moveaxis(own.values, 2, 0)]
    raw = np.concatenate([np.zeros((len(beside), 0)), *(column for _, column in pairs)], axis=1)
    output = np.concatenate([np.zeros(0, dtype=np.int_), *(felt for felt, _ in pairs)])
    starts = np.cumsum([0, *(felt.size for felt, _ in pairs)])[:-1]
    shares = (whitening @ whitening.T)[np.ix_(output, output)]
    at_outputs = whitening @ beside
    across = np.zeros((output.size, beside.shape[2]))
    for k in range(len(whitening)):
        own = output == k
        across[own] = raw[:, own].T @ at_outputs[:, k]
    among = _summed(_summed((raw.T @ raw) * shares, starts).T, starts)
    across = _summed(across, starts)
    flat = beside.reshape(-1, beside.shape[2])
    return np.block([[among, across], [across.T, flat.T @ flat]])


def _summed(values: FloatArray, starts: IntArray) -> FloatArray:
    """Return the sums of the rows from each start to the next."""
    if starts.size == len(values):
        return values
    return np.asarray(np.add.reduceat(values, starts, axis=0))


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
    places = {effect.where for effect in fit.effects if drawn(effect)}
    return bool(places) and regressor.drawn and _WHOLE in {*places, regressor.where}
