"""Sums of products of columns over the rows of each fold, whitened afterwards.

Noise is correlated between outputs, so that a whitened column differs from zero at most outputs; as
it is, a column mostly does so at one. Its products are summed as it is: with W what whitens,
sum over rows of (A W)' (A W) = sum over outputs o, p of (W W')_op A_o' A_p.
Columns that many outputs feel are whitened first: that is fewer products.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
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
    few = np.array([own.outputs.size**2 <= len(whitening) for own in columns], dtype=bool)
    sparse, dense = list(compress(columns, few)), list(compress(columns, ~few))
    sums = []
    for fold in np.unique(folds):
        rows = np.flatnonzero(folds == fold)[::every]
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
