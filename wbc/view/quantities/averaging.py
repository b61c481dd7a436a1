"""Averages over short windows that do not blur what jumps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray

_NEAR = 3


def jump_rows(values: FloatArray, near: Sequence[int]) -> tuple[int, ...]:
    """Return the first row after the largest jump of `values` around each of some rows.

    A recording that gives force and speed of the same step and one that samples them at the same
    instant put the jump of the speeds on different rows; three rows either way are searched.

    Args:
        values: (N, k).
        near: rows at which something hit.
    """
    steps = np.abs(np.diff(values, axis=0)).max(axis=1, initial=0.0)
    found = set()
    for row in near:
        low, high = max(row - _NEAR, 0), min(row + _NEAR, len(steps))
        if high > low:
            found.add(low + int(np.argmax(steps[low:high])) + 1)
    return tuple(sorted(found))


def pieces(size: int, jumps: Sequence[int]) -> list[slice]:
    """Return the slices of `size` rows between jumps; a jump starts a new one."""
    ends = [0, *(row for row in jumps if 0 < row < size), size]
    return [slice(a, b) for a, b in pairwise(ends)]


def window_mean(values: FloatArray, rows: int, jumps: Sequence[int] = ()) -> FloatArray:
    """Return the mean of `values` (N, ...) over `rows` rows around each, never across a jump.

    Towards an end or a jump the window shrinks on both sides, so that a ramp stays a ramp.
    """
    result = np.empty(values.shape)
    for piece in pieces(len(values), jumps):
        size = piece.stop - piece.start
        row = np.arange(size)
        reach = np.minimum(rows // 2, np.minimum(row, size - 1 - row))
        sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values[piece], axis=0)])
        width = (2 * reach + 1).reshape(-1, *(1,) * (values.ndim - 1))
        result[piece] = (sums[row + reach + 1] - sums[row - reach]) / width
    return result


def rate_of_change(values: FloatArray, time: FloatArray, jumps: Sequence[int] = ()) -> FloatArray:
    """Return d/dt of `values` (N, ...) between jumps; 0 in a piece of a single row."""
    result = np.zeros(values.shape)
    for piece in pieces(len(values), jumps):
        if piece.stop - piece.start > 1:
            result[piece] = np.gradient(values[piece], time[piece], axis=0)
    return result
