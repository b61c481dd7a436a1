"""Which rows are held out together, and which are resampled together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.records.record import Record

_BLOCKS_PER_LOG = 5
ROWS_PER_SAMPLE = 2.5  # of the five rows per period of the band, two are independent
_ENOUGH_RUNS = 3
_LONGEST = 4  # share of the shortest log over which residuals are correlated with themselves
_BLOCK_DURATION = 0.5  # [s]; residuals decorrelate within a few periods of the band


def held_out_folds(records: Sequence[Record], repeats: Sequence[tuple[int, int]]) -> IntArray:
    """Return the fold (rows,) of every condensed row.

    With at least three different runs each run is a fold, repeats together; otherwise every run
    is cut into contiguous blocks, because neighbouring rows are not independent. A run that alone
    moves some joint is cut, too: without it nothing would be known of that joint.
    """
    group = _groups(len(records), repeats)
    few = len(set(group)) < _ENOUGH_RUNS
    alone = _only_ones(records, group)
    folds = []
    for record, g in zip(records, group, strict=True):
        if not few and g not in alone:
            folds.append(np.full(record.rows, g * _BLOCKS_PER_LOG))
            continue
        part = np.minimum(
            np.arange(record.rows) * _BLOCKS_PER_LOG // max(record.rows, 1), _BLOCKS_PER_LOG - 1
        )
        folds.append(g * _BLOCKS_PER_LOG + part)
    return np.concatenate(folds)


def rows_of_folds(folds: IntArray) -> list[IntArray | slice]:
    """Return the rows of each fold, in order of their numbers; neighbours as a slice.

    A slice of an array is a view of it, where numbers of rows make a copy.

    Args:
        folds: (rows,) number of the fold of every row.
    """
    parts: list[IntArray | slice] = []
    for fold in np.unique(folds):
        rows = np.flatnonzero(folds == fold)
        first, last = int(rows[0]), int(rows[-1])
        together = last - first + 1 == rows.size
        parts.append(slice(first, last + 1) if together else rows)
    return parts


def bootstrap_blocks(records: Sequence[Record]) -> IntArray:
    """Return the block (rows,) of every row; blocks are long against the band of the residual."""
    blocks, first = [], 0
    for record in records:
        duration = max(_BLOCK_DURATION, 4.0 / record.bandwidth.residual)
        count = max(2, int(record.duration / duration))
        blocks.append(first + np.arange(record.rows) * count // max(record.rows, 1))
        first += count
    return np.concatenate(blocks)


def block_means(values: FloatArray, blocks: IntArray) -> FloatArray:
    """Return the mean (B,) of `values` (rows,) in every block."""
    total = np.bincount(blocks, values)
    count = np.bincount(blocks)
    return np.asarray(total[count > 0] / count[count > 0])


def correlated_rows(parts: Sequence[FloatArray], white: float) -> FloatArray:
    """Return (outputs,) how many rows of some series count as one independent sample.

    Squares of a series are as certain as those of n / (sum over all lags of rho^2) independent
    rows, rho being its autocorrelation (Bartlett). Lags are summed up to a fourth of the shortest
    series; what white noise adds to that sum is taken away.

    Args:
        parts: series (rows, outputs) of at least four rows.
        white: rows of white noise that are one sample; 0 where nothing is to be taken away.
    """
    longest = max(1, min(map(len, parts)) // _LONGEST)
    chance = longest * white / sum(map(len, parts))
    total = np.zeros((longest + 1, parts[0].shape[1]))
    for part in parts:
        power = np.abs(np.fft.rfft(part, 2 * len(part), axis=0)) ** 2
        total += np.fft.irfft(power, axis=0)[: longest + 1]
    correlation = total / np.maximum(total[0], 1e-300)
    lags = np.maximum(np.sum(correlation[1:] ** 2, axis=0) - chance, 0.0)
    return np.asarray(1.0 + 2.0 * lags)


def _only_ones(records: Sequence[Record], group: Sequence[int]) -> set[int]:
    """Return the groups without which some output has no weight in any log."""
    judged = np.array([record.weight.any(axis=0) for record in records])
    per_group = np.array([judged[np.equal(group, g)].any(axis=0) for g in range(max(group) + 1)])
    single = per_group.sum(axis=0) == 1
    return {int(g) for g in np.flatnonzero((per_group & single).any(axis=1))}


def _groups(count: int, repeats: Sequence[tuple[int, int]]) -> list[int]:
    group = list(range(count))
    for first, second in repeats:
        old, new = group[second], group[first]
        group = [new if g == old else g for g in group]
    numbers = {g: k for k, g in enumerate(dict.fromkeys(group))}
    return [numbers[g] for g in group]
