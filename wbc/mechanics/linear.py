"""Small dense linear systems in compiled loops over rows, which use the processor's vectors."""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Places, Row, compiled, inner


@inner
def dot(left: Row, right: Row) -> float:
    """Return the sum of products of two vectors, as long as the left one."""
    total = 0.0
    for i in range(len(left)):
        total += left[i] * right[i]
    return total


@inner
def add_times(share: float, given: Row, total: OutRow) -> None:
    """Add a share of a vector to another one, at least as long."""
    for i in range(len(given)):
        total[i] += share * given[i]


@inner
def go_along(start: Row, end: Row, share: float, place: OutRow) -> None:
    """Write the place a share of the way from one point to another."""
    for i in range(len(start)):
        place[i] = start[i] + share * (end[i] - start[i])


@inner
def add_cross(share: float, left: Row, right: Row, total: OutRow) -> None:
    """Add a share of the cross product of two vectors (3,)."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        total[k] += share * (left[i] * right[j] - left[j] * right[i])


@inner
def apart(left: Row, right: Row) -> float:
    """Return the square of the distance of two points."""
    square = 0.0
    for i in range(len(left)):
        square += (left[i] - right[i]) ** 2
    return square


@inner
def copy_to(given: Row, copied: OutRow) -> None:
    """Write the entries of a vector."""
    for i in range(len(given)):
        copied[i] = given[i]


@inner
def take_pivot(matrix: OutDense, k: int, end: int, pivots: OutPlaces) -> bool:
    """Bring the largest entry of column k to row k and eliminate below, up to column `end`.

    Returns:
        False where the column is zero.
    """
    size, best = len(matrix), k
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
        matrix[i, k] /= matrix[k, k]
        for j in range(k + 1, end):
            matrix[i, j] -= matrix[i, k] * matrix[k, j]
    return True


@compiled(counted=False)
def factor(matrix: OutDense, pivots: OutPlaces) -> bool:
    """Replace a matrix (n, n) by its triangular factors with row pivots; False where singular.

    Four pivots at a time change what is right of them: it is read and written once for the four.
    """
    size, start = len(matrix), 0
    while start < size:
        end = min(start + 4, size)
        for k in range(start, end):
            if not take_pivot(matrix, k, end, pivots):
                return False
        for k in range(start, end):
            for i in range(k + 1, end):
                share = matrix[i, k]
                for j in range(end, size):
                    matrix[i, j] -= share * matrix[k, j]
        for i in range(end, size):  # there are none unless the four are whole
            one, two = matrix[i, start], matrix[i, start + 1]
            three, four = matrix[i, start + 2], matrix[i, start + 3]
            for j in range(end, size):
                taken = one * matrix[start, j] + two * matrix[start + 1, j]
                taken += three * matrix[start + 2, j] + four * matrix[start + 3, j]
                matrix[i, j] -= taken
        start = end
    return True


@compiled(counted=False)
def solve_factored(matrix: Dense, pivots: Places, right: OutRow) -> None:
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


@compiled(counted=False)
def factor_inertia(inertia: Dense, lower: OutDense) -> bool:
    """Write L, the lower half, with L' L = inertia (n, n); False where that is not positive.

    Of the numbers on its diagonal, which only divide, the inverse is written. From the leaves to
    the root, where the zeros between branches of a tree stay zeros (Featherstone).
    """
    size = len(inertia)
    for i in range(size):
        copy_to(inertia[i, : i + 1], lower[i])
    for k in range(size - 1, -1, -1):
        if not lower[k, k] > 0.0:
            return False
        part = 1.0 / np.sqrt(lower[k, k])
        lower[k, k] = part
        for j in range(k):
            lower[k, j] *= part
        for i in range(k):
            share = lower[k, i]
            if share != 0.0:
                for j in range(i + 1):
                    lower[i, j] -= share * lower[k, j]
    return True


@inner
def update_inertia(lower: OutDense, share: float, row: OutRow) -> bool:
    """Change the factors to those of L' L + share row row', and the row (n,); False as above."""
    for k in range(len(row) - 1, -1, -1):
        if row[k] == 0.0:
            continue
        along = row[k] * lower[k, k]
        grown = 1.0 + share * along * along
        if not grown > 0.0:
            return False
        root = np.sqrt(grown)
        more = share * along / root
        lower[k, k] /= root
        for j in range(k):
            row[j] -= along * lower[k, j]
            lower[k, j] = root * lower[k, j] + more * row[j]
        share /= grown
    return True


@inner
def halfway(lower: Dense, right: OutRow) -> None:
    """Replace a row (n,) by L'^-1 of it; the products of such rows are those of H^-1."""
    for i in range(len(lower) - 1, -1, -1):
        if right[i] != 0.0:
            share = right[i] * lower[i, i]
            right[i] = share
            for j in range(i):
                right[j] -= share * lower[i, j]


@inner
def rest_of_way(lower: Dense, right: OutRow) -> None:
    """Replace the right side (n,) by L^-1 of it."""
    for i in range(len(lower)):
        total = 0.0
        for j in range(i):
            total += lower[i, j] * right[j]
        right[i] = (right[i] - total) * lower[i, i]


@inner
def solve_inertia(lower: Dense, right: OutRow) -> None:
    """Replace the right side (n,) by H^-1 of it, where H = L' L."""
    halfway(lower, right)
    rest_of_way(lower, right)


@inner
def products(rows: Dense, gram: OutDense) -> None:
    """Write rows rows' (r, r)."""
    for i in range(len(rows)):
        for j in range(i + 1):
            gram[i, j] = gram[j, i] = dot(rows[i], rows[j])
