"""Independent rows that say the same as rows which may depend on one another, compiled."""

from __future__ import annotations

from math import sqrt

from wbc.arrays import FloatArray
from wbc.compiled import Count, Dense, Nothing, OutDense, compiled

_INDEPENDENT = 1e-8
_PASSES = 2  # the first leaves rounding along rows nearly parallel to those removed


@compiled(Nothing, Dense, Count, OutDense, Count)
def remove(kept: FloatArray, count: int, rows: FloatArray, row: int) -> None:
    """Take the directions of the first `count` orthonormal rows of `kept` out of a row."""
    n = rows.shape[1]
    for i in range(count):
        along = 0.0
        for j in range(n):
            along += kept[i, j] * rows[row, j]
        for j in range(n):
            rows[row, j] -= along * kept[i, j]


@compiled(Count, Dense, OutDense, OutDense, Count)
def extend_basis(rows: FloatArray, left: FloatArray, kept: FloatArray, count: int) -> int:
    """Extend an orthonormal basis by what further rows add to it.

    Gram-Schmidt with the row that has most left next, so that what is dropped is less than 1e-8 of
    a row of length one.

    Args:
        rows: (k, n); their lengths do not matter.
        left: memory (>= k, n).
        kept: orthonormal rows (.., n) with room for k more.
        count: how many there are.

    Returns:
        how many there are now.
    """
    total, n = rows.shape
    for i in range(total):
        length = 0.0
        for j in range(n):
            length += rows[i, j] * rows[i, j]
        scale = 1.0 / sqrt(length) if length > 0.0 else 0.0
        for j in range(n):
            left[i, j] = scale * rows[i, j]
        for _ in range(_PASSES):
            remove(kept, count, left, i)
    for done in range(total):
        best, longest = done, -1.0
        for i in range(done, total):
            length = 0.0
            for j in range(n):
                length += left[i, j] * left[i, j]
            if length > longest:
                best, longest = i, length
        if not longest > _INDEPENDENT**2:
            break
        for j in range(n):
            kept[count, j] = left[best, j]
            left[best, j] = left[done, j]
        remove(kept, count, kept, count)
        length = 0.0
        for j in range(n):
            length += kept[count, j] * kept[count, j]
        scale = 1.0 / sqrt(length)
        for j in range(n):
            kept[count, j] *= scale
        for i in range(done + 1, total):
            along = 0.0
            for j in range(n):
                along += kept[count, j] * left[i, j]
            for j in range(n):
                left[i, j] -= along * kept[count, j]
        count += 1
    return count
