"""Few terms out of many: orthogonal matching pursuit, exchanges, and folds that decide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.identification.discovery.term_table import TermTable

_RIDGE = 1e-7
_ROUNDS = 4  # of exchanges
_TRIED = 12  # exchanges whose friction is checked


@dataclass(frozen=True, eq=False)
class Support:
    """Some terms of a table with least-squares coefficients.

    Attributes:
        chosen: numbers of the terms.
        coefficients: one per term.
        loss: sum of squares that is left in the cells of the fit.
    """

    chosen: tuple[int, ...]
    coefficients: FloatArray
    loss: float


class SparseRegression:
    """Least squares with a given number of terms on some cells of a table."""

    def __init__(self, table: TermTable, cells: BoolArray | IntArray) -> None:
        """Sum up the cells, columns scaled to length one.

        Args:
            table: candidates.
            cells: which cells the fit may see.
        """
        self._table = table
        gram = table.gram[cells].sum(axis=0)
        self._scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        whole = np.sqrt(np.diag(table.gram.sum(axis=0)))
        # A column that hardly moves in these cells cannot be learnt from them.
        self._usable = self._scale > 0.02 * whole
        self._gram = gram / np.outer(self._scale, self._scale) + _RIDGE * np.eye(whole.size)
        self._moment = table.moment[cells].sum(axis=0) / self._scale
        self._energy = float(table.energy[cells].sum())

    def path(self, most: int) -> list[Support]:
        """Return the best supports found with 0, 1, ..., `most` terms that brake where dry."""
        supports = [Support((), np.zeros(0), self._energy)]
        while len(supports) <= most:
            starts = [self._pursuit(len(supports)), supports[-1].chosen]
            found = [self._polished(start, len(supports)) for start in starts]
            better = [s for s in found if s is not None]
            if not better:
                break
            supports.append(min(better, key=lambda s: s.loss))
        return supports

    def fitted(self, chosen: Sequence[int]) -> Support:
        """Return these terms with their coefficients."""
        index = list(chosen)
        solution = np.linalg.solve(self._gram[np.ix_(index, index)], self._moment[index])
        loss = self._energy - float(solution @ self._moment[index])
        return Support(tuple(index), solution / self._scale[index], loss)

    def _pursuit(self, size: int) -> tuple[int, ...]:
        """Return the terms that orthogonal matching pursuit picks (Pati et al. 1993)."""
        # Imported here: it takes a second, and most diagnoses need no discovery.
        from sklearn.linear_model import orthogonal_mp_gram

        usable = np.flatnonzero(self._usable)
        size = min(size, usable.size)
        if size == 0:
            return ()
        weights = orthogonal_mp_gram(
            self._gram[np.ix_(usable, usable)], self._moment[usable], n_nonzero_coefs=size
        )
        return tuple(int(k) for k in usable[np.flatnonzero(weights)])

    def _polished(self, start: Sequence[int], size: int) -> Support | None:
        """Return `size` terms near `start` after exchanges of single terms; None if impossible."""
        chosen = list(start)[:size]
        if len(chosen) < size:
            grown = self._best(chosen)
            if grown is None:
                return None
            chosen = list(grown.chosen)
        current = self._allowed(self.fitted(chosen))
        for _ in range(_ROUNDS):
            offers = [self._best([k for k in chosen if k != out]) for out in chosen]
            usable = [s for s in offers if s is not None]
            if not usable:
                return current
            best = min(usable, key=lambda s: s.loss)
            if current is not None and best.loss > current.loss * (1.0 - 1e-9):
                return current
            current, chosen = best, list(best.chosen)
        return current

    def _best(self, rest: Sequence[int]) -> Support | None:
        """Return the best possible support of `rest` and one term more."""
        losses = self._losses(rest)
        for k in np.argsort(losses)[:_TRIED]:
            if np.isfinite(losses[k]):
                support = self._allowed(self.fitted((*rest, int(k))))
                if support is not None:
                    return support
        return None

    def _losses(self, rest: Sequence[int]) -> FloatArray:
        """Return (c,) what is left with `rest` and each of the terms."""
        index = list(rest)
        inverse = np.linalg.inv(self._gram[np.ix_(index, index)])
        across = self._gram[:, index]
        free = np.diag(self._gram) - np.einsum("ci,ij,cj->c", across, inverse, across)
        pull = self._moment - across @ inverse @ self._moment[index]
        base = self._energy - float(self._moment[index] @ inverse @ self._moment[index])
        usable = self._usable & (free > 1e-5)
        usable[index] = False
        return np.where(usable, base - pull**2 / np.where(usable, free, 1.0), np.inf)

    def _allowed(self, support: Support) -> Support | None:
        fine = self._table.possible(support.chosen, support.coefficients)
        return support if fine else None


def cell_losses(table: TermTable, support: Support, cells: BoolArray) -> FloatArray:
    """Return the sum of squares that a support leaves in each of `cells`."""
    index, c = list(support.chosen), support.coefficients
    explained = 2.0 * table.moment[cells][:, index] @ c
    model = np.einsum("i,kij,j->k", c, table.gram[cells][:, index][:, :, index], c)
    return np.asarray(table.energy[cells] - explained + model)


def block_errors(table: TermTable, losses: FloatArray) -> FloatArray:
    """Return the mean square (blocks,) of cell losses (cells,)."""
    blocks = np.unique(table.blocks, return_inverse=True)[1]
    return np.asarray(np.bincount(blocks, losses) / np.bincount(blocks, table.count))


def held_out(table: TermTable, chosen: Sequence[int]) -> FloatArray:
    """Return cell losses (cells,) of these terms, each fold with coefficients of the others."""
    losses = np.zeros(len(table.folds))
    for fold in np.unique(table.folds):
        inside = table.folds == fold
        support = SparseRegression(table, ~inside).fitted(chosen)
        losses[inside] = cell_losses(table, support, inside)
    return losses
