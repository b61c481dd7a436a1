"""Small dense linear systems in compiled loops over rows, which use the processor's vectors."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Dense, Flag, Nothing, OutDense, OutPlaces, OutVector, Places, compiled


@compiled(Flag, OutDense, OutPlaces)
def factor(matrix: FloatArray, pivots: IntArray) -> bool:
    """Replace a matrix (n, n) by its triangular factors with row pivots; False where singular."""
    size = len(matrix)
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        if matrix[k, k] == 0.0:
            return False
        for i in range(k + 1, size):
            if matrix[i, k] != 0.0:
                share = matrix[i, k] / matrix[k, k]
                matrix[i, k] = share
                for j in range(k + 1, size):
                    matrix[i, j] -= share * matrix[k, j]
    return True


@compiled(Nothing, Dense, Places, OutVector)
def solve_factored(matrix: FloatArray, pivots: IntArray, right: FloatArray) -> None:
    """Replace the right side (n,) by the solution, with what `factor` left."""
    size = len(right)
    for k in range(size):
        if pivots[k] != k:
            right[k], right[pivots[k]] = right[pivots[k]], right[k]
    for i in range(size):
        total = 0.0
        for j in range(i):
            total += matrix[i, j] * right[j]
        right[i] -= total
    for i in range(size - 1, -1, -1):
        total = 0.0
        for j in range(i + 1, size):
            total += matrix[i, j] * right[j]
        right[i] = (right[i] - total) / matrix[i, i]


@compiled(Flag, Dense, OutDense)
def cholesky(matrix: FloatArray, lower: FloatArray) -> bool:
    """Write L with L L' = matrix (n, n), symmetric; False where it is not positive definite."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = 0.0
            for k in range(j):
                total += lower[i, k] * lower[j, k]
            value = matrix[i, j] - total
            if i != j:
                lower[i, j] = value / lower[j, j]
            elif value > 0.0:
                lower[i, i] = np.sqrt(value)
            else:
                return False
    return True


@compiled(Nothing, Dense, Dense, OutDense)
def forward(lower: FloatArray, rows: FloatArray, solved: FloatArray) -> None:
    """Write L^-1 row for every row (r, n); leading zeros stay zeros."""
    size = len(lower)
    for r in range(len(rows)):
        first = 0
        while first < size and rows[r, first] == 0.0:
            solved[r, first] = 0.0
            first += 1
        for i in range(first, size):
            total = 0.0
            for j in range(first, i):
                total += lower[i, j] * solved[r, j]
            solved[r, i] = (rows[r, i] - total) / lower[i, i]


@compiled(Nothing, Dense, OutVector)
def backward(lower: FloatArray, right: FloatArray) -> None:
    """Replace the right side (n,) by L'^-1 of it."""
    size = len(lower)
    for i in range(size - 1, -1, -1):
        right[i] /= lower[i, i]
        for j in range(i):
            right[j] -= lower[i, j] * right[i]


@compiled(Nothing, Dense, OutDense)
def products(rows: FloatArray, gram: FloatArray) -> None:
    """Write rows rows' (r, r)."""
    for i in range(len(rows)):
        for j in range(i + 1):
            total = 0.0
            for k in range(rows.shape[1]):
                total += rows[i, k] * rows[j, k]
            gram[i, j] = gram[j, i] = total
