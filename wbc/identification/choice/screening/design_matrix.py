"""Normal equations per fold: any set of columns is fitted and judged without touching rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.choice.screening.fold_sums import fold_sums

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
        sums = fold_sums((), columns, residual, np.eye(columns.shape[1]), folds, 1)
        prior = np.zeros(size) if expected is None else expected
        return cls(*sums, prior, usual or (np.zeros((size, size)), np.zeros(size)))

    def fit(self, chosen: Sequence[int]) -> FloatArray:
        """Return the least-squares coefficients of these columns on all folds."""
        index = np.asarray(chosen, dtype=np.int_)
        if index.size == 0:
            return np.zeros(0)
        gram, moment = self._whole
        return _solve(gram[np.ix_(index, index)], moment[index])

    def moved(self, chosen: Sequence[int], steps: FloatArray) -> DesignMatrix:
        """Return the same for a residual from which some columns times `steps` are taken."""
        index = np.asarray(chosen, dtype=np.int_)
        along = self.gram[:, :, index] @ steps
        energy = self.energy - 2.0 * self.moment[:, index] @ steps + along[:, index] @ steps
        return replace(self, moment=self.moment - along, energy=energy)

    @cached_property
    def _whole(self) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of all folds with what is known before."""
        gram, moment = self.usual
        return gram + self.gram.sum(axis=0), moment + self.moment.sum(axis=0)

    def gains_of_two(self, count: int, beside: Sequence[int]) -> FloatArray:
        """Return (n, n) what every two of the first n columns explain beside others.

        Sums of squares of the residual, fitted and judged on all folds.

        Args:
            count: n.
            beside: numbers of the columns that stay free.
        """
        gram, moment = self._whole
        own, others = np.arange(count), np.asarray(beside, dtype=np.int_)
        across, rest = gram[np.ix_(others, own)], gram[np.ix_(others, others)]
        gram, left = gram[:count, :count], moment[:count]
        if others.size:
            taken = _solve(rest, np.column_stack([across, moment[others]]).T).T
            left = left - across.T @ taken[:, -1]
            gram = gram - across.T @ taken[:, :-1]
        moment = left
        size = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        along, shared = moment / size, gram / np.outer(size, size)
        apart = 1.0 - shared**2
        both = along[:, None] ** 2 + along**2 - 2.0 * shared * np.outer(along, along)
        clear = apart > _ALIKE
        single = np.maximum(along[:, None] ** 2, along**2)
        return np.asarray(np.where(clear, both / np.where(clear, apart, 1.0), single))

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
            taken = _solve(gram[np.ix_(index, index)], right.T).T
            energy -= float(moment[index] @ taken[:, -1])
            moment = moment - gram[:, index] @ taken[:, -1]
            gram = gram - gram[:, index] @ taken[:, :-1]
        gains = np.zeros(len(groups))
        for k, group in enumerate(groups):
            own = np.asarray(group, dtype=np.int_)
            gains[k] = moment[own] @ _solve(gram[np.ix_(own, own)], moment[own])
        return np.asarray(np.maximum(energy - gains, 0.0) / self.count.sum())

    def held_out(self, chosen: Sequence[int]) -> float:
        """Return the mean square of the residual on folds left out of the fit."""
        index = np.asarray(chosen, dtype=np.int_)
        total = float(self.energy.sum())
        if index.size == 0:
            return total / float(self.count.sum())
        gram = self.gram[:, index[:, None], index[None, :]]
        moment = self.moment[:, index]
        whole = gram.sum(axis=0)
        # A column that only the held-out fold knows must not be extrapolated from nothing.
        shrink = _RIDGE_HELD_OUT * np.diag(whole)
        usual, pull = self.usual[0][np.ix_(index, index)], self.usual[1][index]
        others = moment.sum(axis=0) - moment + shrink * self.expected[index] + pull
        rest = _solve(whole - gram + np.diag(shrink) + usual, others)
        explained = 2.0 * np.einsum("ki,ki->", rest, moment)
        model = np.einsum("ki,kij,kj->", rest, gram, rest)
        return float((total - explained + model) / self.count.sum())


def _solve(gram: FloatArray, moment: FloatArray) -> FloatArray:
    """Solve normal equations after scaling the diagonal to one, with a tiny ridge."""
    diagonal = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300))
    scaled = gram / diagonal[..., :, None] / diagonal[..., None, :]
    scaled = scaled + _RIDGE * np.eye(scaled.shape[-1])
    solution = np.linalg.solve(scaled, (moment / diagonal)[..., None])[..., 0]
    return np.asarray(solution / diagonal)
