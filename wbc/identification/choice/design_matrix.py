"""Normal equations per fold: any set of columns is fitted and judged without touching rows.

Noise is correlated between outputs, so that a whitened column differs from zero at most outputs; as
it is, a column mostly does so at one. Its products are summed as it is: with W what whitens,
sum over rows of (A W)' (A W) = sum over outputs o, p of (W W')_op A_o' A_p.
Columns that many outputs feel are whitened first: that is fewer products.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.identification.model.columns import SparseColumns

_RIDGE = 1e-10
_RIDGE_HELD_OUT = 1e-3
_ALIKE = 1e-6  # of squares, that two columns must differ by to be two


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Whitened columns of all regressors and the whitened residual, summed up per fold.

    Attributes:
        gram: (K, c, c) A_k' A_k.
        moment: (K, c) A_k' r_k.
        energy: (K,) r_k' r_k.
        count: (K,) entries of r_k.
        expected: (c,) coefficients where a fold alone knows a column.
        usual: (c, c) and (c,) what is known of the coefficients before, as normal equations.
    """

    gram: FloatArray
    moment: FloatArray
    energy: FloatArray
    count: FloatArray
    expected: FloatArray
    usual: tuple[FloatArray, FloatArray]

    @classmethod
    def from_rows(
        cls,
        columns: FloatArray,
        residual: FloatArray,
        folds: IntArray,
        expected: FloatArray | None = None,
        usual: tuple[FloatArray, FloatArray] | None = None,
    ) -> DesignMatrix:
        """Sum up rows.

        Args:
            columns: (rows, outputs, c), whitened.
            residual: (rows, outputs), whitened.
            folds: (rows,) number of the fold of each row.
            expected: (c,) coefficients to believe in where nothing is known, by default zero.
            usual: (c, c) and (c,) normal equations of what is known before, by default nothing.
        """
        size = columns.shape[2]
        sums = fold_sums((), columns, residual, np.eye(columns.shape[1]), folds)
        prior = np.zeros(size) if expected is None else expected
        return cls(*sums, prior, usual or (np.zeros((size, size)), np.zeros(size)))

    def moved(self, chosen: Sequence[int], steps: FloatArray) -> DesignMatrix:
        """Return the same for a residual from which some columns times `steps` are taken."""
        index = np.asarray(chosen, dtype=np.int_)
        along = self.gram[:, :, index] @ steps
        energy = self.energy - 2.0 * self.moment[:, index] @ steps + along[:, index] @ steps
        return replace(self, moment=self.moment - along, energy=energy)

    def least_errors(self, groups: Sequence[Sequence[int]], beside: Sequence[int]) -> FloatArray:
        """Return (n,) bounds below what each group of columns leaves on folds left out.

        What it leaves where it is fitted, with nothing known before: leaving out a fold multiplies
        the fold's residual by (1 - H)^-1, H being its part of the hat matrix, which shortens none.

        Args:
            groups: numbers of columns.
            beside: numbers of columns that stay free with each.
        """
        gram, moment = self.gram.sum(axis=0), self.moment.sum(axis=0)
        energy = float(self.energy.sum())
        index = np.asarray(beside, dtype=np.int_)
        if index.size:
            right = np.column_stack([gram[index], moment[index]])
            taken = _solve(gram[np.ix_(index, index)], right)
            energy -= float(moment[index] @ taken[:, -1])
            moment = moment - gram[:, index] @ taken[:, -1]
            gram = gram - gram[:, index] @ taken[:, :-1]
        gains = np.zeros(len(groups))
        for k, group in enumerate(groups):
            own = np.asarray(group, dtype=np.int_)
            gains[k] = moment[own] @ _solve(gram[np.ix_(own, own)], moment[own, None])[:, 0]
        return np.asarray(np.maximum(energy - gains, 0.0) / self.count.sum())


class Beside:
    """Fits sets of columns beside others that stay free: without each fold, and last on all.

    The others are eliminated once (Schur complement): a set costs a system of its own size.
    """

    def __init__(self, matrix: DesignMatrix, others: Sequence[int]) -> None:
        """Eliminate the others."""
        self._sums, self._others = matrix, np.asarray(others, dtype=np.int_)
        whole = np.einsum("kii->i", matrix.gram)
        # A column that only the held-out fold knows must not be extrapolated from nothing.
        self._shrink = _RIDGE_HELD_OUT * whole
        moment = matrix.moment.sum(axis=0) + matrix.usual[1]
        without = moment - matrix.moment + self._shrink * matrix.expected
        self._right = np.concatenate([without, moment[None]])
        self._across = self._normal(self._others, np.arange(whole.size))
        both = np.concatenate([self._across, self._right[:, self._others, None]], axis=2)
        self._taken = _solve(self._across[:, :, self._others], both)

    def fit(self, chosen: Sequence[int]) -> FloatArray:
        """Return the least-squares coefficients of these columns on all folds."""
        return np.asarray(self._fits(chosen)[-1])

    def held_out(self, chosen: Sequence[int]) -> float:
        """Return the mean square of the residual on folds left out of the fit."""
        sums, index = self._sums, np.concatenate([np.asarray(chosen, dtype=np.int_), self._others])
        own = self._fits(chosen)[:-1]
        taken = self._taken[:-1]
        beside = taken[..., -1] - np.einsum("kic,kc->ki", taken[..., list(chosen)], own)
        rest = np.concatenate([own, beside], axis=1)
        explained = 2.0 * np.einsum("ki,ki->", rest, sums.moment[:, index])
        model = np.einsum("ki,kij,kj->", rest, sums.gram[:, index[:, None], index], rest)
        return float((sums.energy.sum() - explained + model) / sums.count.sum())

    def gains_of_two(self, count: int) -> FloatArray:
        """Return (n, n) what every two of the first n columns explain.

        Sums of squares of the residual, fitted and judged on all folds.

        Args:
            count: n.
        """
        own = np.arange(count)
        across, taken = self._across[-1][:, own].T, self._taken[-1]
        gram = self._normal(own, own)[-1] - across @ taken[:, own]
        moment = self._right[-1, own] - across @ taken[:, -1]
        size = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        along, shared = moment / size, gram / np.outer(size, size)
        apart = 1.0 - shared**2
        both = along[:, None] ** 2 + along**2 - 2.0 * shared * np.outer(along, along)
        clear = apart > _ALIKE
        single = np.maximum(along[:, None] ** 2, along**2)
        return np.asarray(np.where(clear, both / np.where(clear, apart, 1.0), single))

    def _fits(self, chosen: Sequence[int]) -> FloatArray:
        """Return (K + 1, r) the coefficients of these columns in each fit."""
        own = np.asarray(chosen, dtype=np.int_)
        across = self._across[:, :, own].swapaxes(1, 2)
        whole = self._normal(own, own)
        apart = whole - across @ self._taken[..., own]
        right = self._right[:, own] - (across @ self._taken[..., -1:])[..., 0]
        return _solve(apart, right[..., None], whole)[..., 0]

    def _normal(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Return (K + 1, r, c) a part of the normal matrices."""
        gram = self._sums.gram[:, rows[:, None], columns]
        whole = gram.sum(axis=0) + self._sums.usual[0][rows[:, None], columns]
        shrink = np.where(rows[:, None] == columns, self._shrink[columns], 0.0)
        return np.concatenate([whole - gram + shrink, whole[None]])


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


class FoldSums(NamedTuple):
    """What a linear fit needs to know of its rows, by fold."""

    gram: FloatArray
    """(K, c, c) products of columns."""
    moment: FloatArray
    """(K, c) of columns and residual."""
    energy: FloatArray
    """(K,) of the residual with itself."""
    entries: FloatArray
    """(K,) of the residual."""


def fold_sums(
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
    for fold in np.unique(folds):
        rows = np.flatnonzero(folds == fold)
        more = [own.at_rows(rows).whitened(whitening) for own in dense]
        beside = np.concatenate([*more, whitened[rows], residual[rows, :, None]], axis=2)
        products = _products([own.at_rows(rows) for own in sparse], beside, whitening)
        sums.append((products[:-1, :-1], products[:-1, -1], products[-1, -1], beside[..., 0].size))
    gram, moment, energy, entries = (
        np.array(part, dtype=float) for part in zip(*sums, strict=True)
    )
    place = _places(columns, few, whitened.shape[2])
    return FoldSums(gram[:, place[:, None], place], moment[:, place], energy, entries)


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
    parts = [own.values.swapaxes(1, 2).reshape(len(beside), -1) for own in sparse]
    raw = np.concatenate([np.zeros((len(beside), 0)), *parts], axis=1)
    felt = [np.tile(own.outputs, own.values.shape[2]) for own in sparse]
    output = np.concatenate([np.zeros(0, dtype=np.int_), *felt])
    sizes = [own.outputs.size for own in sparse for _ in range(own.values.shape[2])]
    starts = np.cumsum([0, *sizes])[:-1]
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


def _places(columns: Sequence[SparseColumns], first: BoolArray, more: int) -> IntArray:
    """Return where each column stands once some come first, then the others, then `more`."""
    widths = np.array([own.values.shape[2] for own in columns], dtype=np.int_)
    late = np.concatenate([np.repeat(~first, widths), np.ones(more, dtype=bool)])
    return np.argsort(np.argsort(late, kind="stable"))


def _summed(values: FloatArray, starts: IntArray) -> FloatArray:
    """Return the sums of the rows from each start to the next."""
    if starts.size == len(values):
        return values
    return np.asarray(np.add.reduceat(values, starts, axis=0))
