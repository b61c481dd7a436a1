"""Few terms out of many: supports that grow, exchanges, and folds that decide."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.identification.formulas.term_table import TermTable

_RIDGE = 1e-7
_ROUNDS = 4  # of exchanges
_TRIED = 10  # additions to a support that are fitted
_BEAM = 6  # supports kept per size
_PAIRS = 40
_CANCELLING = 10.0  # squares of the single terms over the square of their sum


@dataclass(frozen=True, eq=False)
class TermSet:
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

    def path(self, most: int) -> list[TermSet]:
        """Return the best supports found with 0, 1, ..., `most` terms that brake where dry.

        A beam of supports grows by one term at a time, joined by the best of all pairs, since two
        terms may do together what neither does alone. The best of each size is improved by
        exchanges.
        """
        best = [TermSet((), np.zeros(0), self._energy)]
        beam: list[tuple[int, ...]] = [()]
        for size in range(1, most + 1):
            offers = [chosen for rest in beam for chosen in self._extensions(rest)]
            offers += self._pairs() if size == 2 else []
            distinct = dict.fromkeys(tuple(sorted(o)) for o in offers)
            found = list(islice(self._allowed(list(distinct)), _BEAM))
            if not found:
                break
            best.append(self._exchanged(found[0]))
            beam = list(dict.fromkeys(s.chosen for s in (best[-1], *found)))[:_BEAM]
        return best

    def fitted(self, chosen: Sequence[int]) -> TermSet:
        """Return these terms with their coefficients."""
        return next(self._fits(np.array([chosen], dtype=np.int_)))

    def _fits(self, offers: IntArray) -> Iterator[TermSet]:
        """Yield the supports (S, k) with their coefficients, from the least loss on."""
        gram = self._gram[offers[:, :, None], offers[:, None, :]]
        moment = self._moment[offers]
        solutions = np.linalg.solve(gram, moment[..., None])[..., 0]
        losses = self._energy - np.sum(solutions * moment, axis=1)
        for k in np.argsort(losses, kind="stable"):
            chosen, coefficients = offers[k], solutions[k] / self._scale[offers[k]]
            yield TermSet(tuple(chosen.tolist()), coefficients, float(losses[k]))

    def _exchanged(self, support: TermSet) -> TermSet:
        """Return the support after exchanges of single terms, as long as they help."""
        current = support
        for _ in range(_ROUNDS):
            offers = [
                offer
                for out in current.chosen
                for offer in self._extensions([k for k in current.chosen if k != out])
            ]
            better = next(self._allowed(offers), current)
            if better.loss > current.loss * (1.0 - 1e-9):
                break
            current = better
        return current

    def _extensions(self, rest: Sequence[int]) -> list[tuple[int, ...]]:
        """Return the most promising supports of `rest` and one term more."""
        losses = self._losses(rest)
        order = np.argsort(losses)[:_TRIED]
        return [(*rest, int(k)) for k in order if np.isfinite(losses[k])]

    def _pairs(self) -> list[tuple[int, ...]]:
        """Return the best pairs of all."""
        usable = np.flatnonzero(self._usable)
        gram, b = self._gram[np.ix_(usable, usable)], self._moment[usable]
        free = 1.0 - gram**2
        gain = (b[:, None] ** 2 - 2.0 * gram * np.outer(b, b) + b**2) / np.maximum(free, 1e-5)
        gain[np.tril_indices(usable.size)] = -np.inf
        gain[free < 1e-5] = -np.inf
        best = np.argsort(-gain, axis=None)[:_PAIRS]
        rows, columns = np.unravel_index(best, gain.shape)
        return [(int(usable[i]), int(usable[j])) for i, j in zip(rows, columns, strict=True)]

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

    def _allowed(self, offers: Sequence[tuple[int, ...]]) -> Iterator[TermSet]:
        """Yield supports of one size from the least loss on.

        Those whose friction drives, or whose terms mostly cancel one another, are left out.
        """
        for support in self._fits(np.array(offers, dtype=np.int_)) if offers else ():
            index = list(support.chosen)
            sizes = support.coefficients * self._scale[index]
            together = float(sizes @ self._gram[np.ix_(index, index)] @ sizes)
            fine = float(sizes @ sizes) <= _CANCELLING * together
            if fine and self._table.possible(index, support.coefficients):
                yield support


def cell_losses(table: TermTable, support: TermSet, cells: BoolArray) -> FloatArray:
    """Return the sum of squares that a support leaves in each of `cells`."""
    index, c = np.asarray(support.chosen, dtype=np.int_), support.coefficients
    explained = 2.0 * table.moment[cells][:, index] @ c
    gram = table.gram[np.ix_(np.flatnonzero(cells), index, index)]
    model = np.einsum("i,kij,j->k", c, gram, c)
    return np.asarray(table.energy[cells] - explained + model)


def block_errors(table: TermTable, losses: FloatArray) -> FloatArray:
    """Return the mean square (blocks,) of cell losses (cells,)."""
    blocks = np.unique(table.blocks, return_inverse=True)[1]
    return np.asarray(np.bincount(blocks, losses) / np.bincount(blocks, table.count))


def fold_regressions(table: TermTable) -> list[tuple[BoolArray, SparseRegression]]:
    """Return, for every fold, its cells and the regression on all others."""
    return [
        (table.folds == fold, SparseRegression(table, table.folds != fold))
        for fold in np.unique(table.folds)
    ]


def held_out(
    table: TermTable,
    chosen: Sequence[int],
    folds: Sequence[tuple[BoolArray, SparseRegression]],
) -> FloatArray:
    """Return cell losses (cells,) of these terms, each fold with coefficients of the others."""
    losses = np.zeros(len(table.folds))
    for inside, others in folds:
        losses[inside] = cell_losses(table, others.fitted(chosen), inside)
    return losses
