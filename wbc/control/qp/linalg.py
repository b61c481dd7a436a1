"""Small linear algebra: positive definite systems, and rows made orthonormal, compiled."""

from __future__ import annotations

from math import sqrt

from wbc.compiled import Dense, OutDense, OutRow, compiled, inner
from wbc.mechanics.linear import add_times, copy_to, dot

_INDEPENDENT = 1e-8
_SHORT = 0.25  # of a squared length, from which rounding along the other rows counts


@compiled
def _place_diagonal(matrix: OutDense, i: int) -> bool:
    """Write the inverse of the factor's diagonal entry of a row; return whether there is one."""
    left = matrix[i, i]
    for k in range(i):
        left -= matrix[i, k] * matrix[i, k]
    if not left > 0.0:
        return False
    matrix[i, i] = 1.0 / sqrt(left)
    return True


@compiled
def factorise_from(matrix: OutDense, start: int, size: int) -> bool:
    """Overwrite the lower half of the leading block with its Cholesky factor, from a row on.

    The diagonal holds the inverses of the factor's. Only the lower half is read. Two rows are
    worked out at a time: both need the rows above them, which are then read once (24 rows take
    1.24 instead of 1.87 us, 48 rows 4.2 instead of 7.1 us).

    Args:
        matrix: its rows before `start` hold the factor already.
        start, size: rows.

    Returns:
        whether the block is positive definite.
    """
    for i in range(start, size, 2):
        pair = i + 1 < size
        for j in range(i):
            left, below = matrix[i, j], 0.0
            if pair:
                below = matrix[i + 1, j]
                for k in range(j):
                    left -= matrix[i, k] * matrix[j, k]
                    below -= matrix[i + 1, k] * matrix[j, k]
                matrix[i + 1, j] = below * matrix[j, j]
            else:
                for k in range(j):
                    left -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = left * matrix[j, j]
        if not _place_diagonal(matrix, i):
            return False
        if pair:
            below = matrix[i + 1, i]
            for k in range(i):
                below -= matrix[i + 1, k] * matrix[i, k]
            matrix[i + 1, i] = below * matrix[i, i]
            if not _place_diagonal(matrix, i + 1):
                return False
    return True


@inner
def drop_row(factor: OutDense, half: OutRow, place: int, size: int) -> None:
    """Take a row out of a matrix whose factor L is that of `factorise_from`, and L^-1 r with it.

    What is left of L has one entry right of the diagonal in every row; rotations of neighbouring
    columns make it triangular again.

    Args:
        factor: L of `size` rows; result.
        half: L^-1 r (>= size,); result.
        place: which row goes.
    """
    for j in range(place, size - 1):
        cosine, sine = factor[j + 1, j], 1.0 / factor[j + 1, j + 1]
        length = sqrt(cosine * cosine + sine * sine)
        cosine, sine = cosine / length, sine / length
        for i in range(j + 2, size):
            one, other = factor[i, j], factor[i, j + 1]
            factor[i, j] = cosine * one + sine * other
            factor[i, j + 1] = cosine * other - sine * one
        one, other = half[j], half[j + 1]
        half[j], half[j + 1] = cosine * one + sine * other, cosine * other - sine * one
        copy_to(factor[j + 1, :j], factor[j])
        factor[j, j] = 1.0 / length


@inner
def substitute_back(factor: Dense, size: int, values: OutRow) -> None:
    """Overwrite the first `size` values (..,) with L'^-1 of them, `factor` as of `substitute`."""
    for i in range(size - 1, -1, -1):
        values[i] *= factor[i, i]
        add_times(-values[i], factor[i, :i], values)


@inner
def substitute(factor: Dense, size: int, values: OutRow) -> None:
    """Overwrite the first `size` values (..,) with the solution, `factor` from `factorise_from`."""
    for i in range(size):
        values[i] = (values[i] - dot(values[:i], factor[i])) * factor[i, i]
    substitute_back(factor, size, values)


@inner
def remove(kept: Dense, count: int, rows: OutDense, row: int, n: int) -> None:
    """Take the directions of the first `count` orthonormal rows of `kept` out of a row.

    Only the first n columns are read; behind them all these rows are zero.
    """
    for i in range(count):
        add_times(-dot(kept[i, :n], rows[row]), kept[i, :n], rows[row])


@compiled(counted=False)
def extend_basis(rows: Dense, left: OutDense, kept: OutDense, count: int, n: int) -> int:
    """Extend an orthonormal basis by what further rows add to it.

    Gram-Schmidt with the row that has most left next, so that what is dropped is less than 1e-8 of
    a row of length one.

    Args:
        rows: (k, ..); their lengths do not matter.
        left: memory (>= k, ..).
        kept: orthonormal rows (.., ..) with room for k more.
        count: how many there are.
        n: how many columns the rows have; what stands behind these is neither read nor written.

    Returns:
        how many there are now.
    """
    total = len(rows)
    for i in range(total):
        length = dot(rows[i, :n], rows[i])
        scale = 1.0 / sqrt(length) if length > 0.0 else 0.0
        for j in range(n):
            left[i, j] = scale * rows[i, j]
        remove(kept, count, left, i, n)
    for done in range(min(total, n - count)):
        best, longest = done, -1.0
        for i in range(done, total):
            length = dot(left[i, :n], left[i])
            if length > longest:
                best, longest = i, length
        if not longest > _INDEPENDENT**2:
            break
        copy_to(left[best, :n], kept[count])
        copy_to(left[done, :n], left[best])
        length = longest
        if longest < _SHORT:
            remove(kept, count, kept, count, n)
            length = dot(kept[count, :n], kept[count])
        scale = 1.0 / sqrt(length)
        for j in range(n):
            kept[count, j] *= scale
        for i in range(done + 1, total):
            add_times(-dot(kept[count, :n], left[i]), kept[count, :n], left[i])
        count += 1
    return count
