"""Sums of products of columns over the rows of each fold, whitened afterwards.

Noise is correlated between outputs, so that a whitened column differs from zero at most outputs; as
it is, a column does so at one. Its products are summed as it is: with W what whitens,
sum over rows of (A W)' (A W) = sum over outputs o, p of (W W')_op A_o' A_p.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.columns.sparse_columns import SparseColumns


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
    every: int,
) -> FoldSums:
    """Return the sums of all columns, those that are not whitened yet first.

    Args:
        columns: (rows, outputs, r) each, not whitened.
        whitened: (rows, judged outputs, p) more columns.
        residual: (rows, judged outputs), whitened.
        whitening: (outputs, judged outputs).
        folds: (rows,) number of the fold of each row.
        every: step between two rows of a fold that count.
    """
    # Of each column what single outputs feel, side by side.
    felt = [np.tile(own.outputs, own.values.shape[2]) for own in columns]
    output = np.concatenate(felt) if felt else np.zeros(0, dtype=np.int_)
    sizes = [own.outputs.size for own in columns for _ in range(own.values.shape[2])]
    starts = np.cumsum([0, *sizes])[:-1]
    shares = (whitening @ whitening.T)[np.ix_(output, output)]
    more = np.concatenate([whitened, residual[:, :, None]], axis=2)
    gram, moment, energy, entries = [], [], [], []
    for fold in np.unique(folds):
        rows = np.flatnonzero(folds == fold)[::every]
        parts = [own.values[rows].swapaxes(1, 2).reshape(rows.size, -1) for own in columns]
        raw = np.concatenate([np.zeros((rows.size, 0)), *parts], axis=1)
        beside = more[rows]
        across = np.zeros((output.size, beside.shape[2]))
        for k, share in enumerate(whitening):
            own = output == k
            across[own] = raw[:, own].T @ np.tensordot(beside, share, (1, 0))
        products = _summed(_summed((raw.T @ raw) * shares, starts).T, starts)
        across = _summed(across, starts)
        flat = beside.reshape(-1, beside.shape[2])
        rest = flat.T @ flat
        gram.append(np.block([[products, across[:, :-1]], [across[:, :-1].T, rest[:-1, :-1]]]))
        moment.append(np.concatenate([across[:, -1], rest[:-1, -1]]))
        energy.append(rest[-1, -1])
        entries.append(float(len(flat)))
    return FoldSums(np.array(gram), np.array(moment), np.array(energy), np.array(entries))


def _summed(values: FloatArray, starts: IntArray) -> FloatArray:
    """Return the sums of the rows from each start to the next."""
    if starts.size == len(values):
        return values
    return np.asarray(np.add.reduceat(values, starts, axis=0))
