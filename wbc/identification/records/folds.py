"""Which rows are held out together, and which are resampled together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.records.record import Record

_BLOCKS_PER_LOG = 5
ROWS_PER_SAMPLE = 2.5  # of the five rows per period of the band, two are independent
_ENOUGH_RUNS = 3
_BLOCK_DURATION = 0.5  # [s]; residuals decorrelate within a few periods of the band


def held_out_folds(records: Sequence[Record], repeats: Sequence[tuple[int, int]]) -> IntArray:
    """Return the fold (rows,) of every condensed row.

    With at least three different runs each run is a fold, repeats together; otherwise every run
    is cut into contiguous blocks, because neighbouring rows are not independent.
    """
    group = _groups(len(records), repeats)
    if len(set(group)) >= _ENOUGH_RUNS:
        return np.concatenate([np.full(r.rows, g) for r, g in zip(records, group, strict=True)])
    folds = []
    for record, g in zip(records, group, strict=True):
        part = np.minimum(
            np.arange(record.rows) * _BLOCKS_PER_LOG // max(record.rows, 1), _BLOCKS_PER_LOG - 1
        )
        folds.append(g * _BLOCKS_PER_LOG + part)
    return np.concatenate(folds)


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


def _groups(count: int, repeats: Sequence[tuple[int, int]]) -> list[int]:
    group = list(range(count))
    for first, second in repeats:
        old, new = group[second], group[first]
        group = [new if g == old else g for g in group]
    numbers = {g: k for k, g in enumerate(dict.fromkeys(group))}
    return [numbers[g] for g in group]
