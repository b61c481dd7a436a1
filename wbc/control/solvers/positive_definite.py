"""Solving small positive definite systems."""

from __future__ import annotations

from math import sqrt

from wbc.arrays import FloatArray
from wbc.compiled import Count, Dense, Flag, Nothing, OutDense, OutRow, compiled


@compiled(Flag, OutDense, Count)
def factorise(matrix: FloatArray, size: int) -> bool:
    """Overwrite the lower half of the leading block with its Cholesky factor.

    The diagonal holds the inverses of the factor's. Only the lower half is read.

    Returns:
        whether the block is positive definite.
    """
    for i in range(size):
        for j in range(i):
            left = matrix[i, j]
            for k in range(j):
                left -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = left * matrix[j, j]
        left = matrix[i, i]
        for k in range(i):
            left -= matrix[i, k] * matrix[i, k]
        if not left > 0.0:
            return False
        matrix[i, i] = 1.0 / sqrt(left)
    return True


@compiled(Nothing, Dense, Count, OutRow)
def substitute(factor: FloatArray, size: int, values: FloatArray) -> None:
    """Overwrite the first `size` values (..,) with the solution, `factor` from `factorise`."""
    for i in range(size):
        left = values[i]
        for k in range(i):
            left -= factor[i, k] * values[k]
        values[i] = left * factor[i, i]
    for i in range(size - 1, -1, -1):
        values[i] *= factor[i, i]
        for k in range(i):
            values[k] -= factor[i, k] * values[i]
