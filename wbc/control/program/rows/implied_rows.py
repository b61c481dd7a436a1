"""Bounds that leave no way but one, compiled: they are equalities in all but name."""

from __future__ import annotations

from math import sqrt

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Nothing,
    Number,
    OutDense,
    OutPlaces,
    OutRow,
    Row,
    compiled,
)
from wbc.control.program.rows.orthonormal_rows import remove
from wbc.control.solvers.positive_definite import factorise, substitute

_HALF = 0.5
_ROUNDING = 1e-9  # of a push or a pull, whose size is one


@compiled(Count, Dense, Row, Row, Row, Number, Row, OutDense, OutPlaces)
def gather_binding(
    C: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    x: FloatArray,
    reach: float,
    scales: FloatArray,
    binding: FloatArray,
    places: IntArray,
) -> int:
    """Write the rows of C (r, n) that x (n,) has at a bound: outwards, scaled, of length one.

    Args:
        C, lower, upper, x: of the program.
        reach: how near a bound counts as there.
        scales: what the columns are multiplied with (n,).
        binding, places: results (r, n), and their numbers (r,).

    Returns:
        how many there are.
    """
    count = 0
    for i in range(len(lower)):
        value, length = 0.0, 0.0
        for j in range(len(x)):
            value += C[i, j] * x[j]
            length += (C[i, j] * scales[j]) ** 2
        high = value > upper[i] - reach
        if length > 0.0 and (high or value < lower[i] + reach):
            sign = (1.0 if high else -1.0) / sqrt(length)
            for j in range(len(x)):
                binding[count, j] = sign * C[i, j] * scales[j]
            places[count], count = i, count + 1
    return count


@compiled(Count, Dense, Count, OutRow, OutPlaces, Number, OutDense, OutRow)
def _correct(
    products: FloatArray,
    count: int,
    push: FloatArray,
    pushing: IntArray,
    regular: float,
    system: FloatArray,
    left: FloatArray,
) -> int:
    """Solve with the rows taken as pushing; return how many were taken wrongly, and turn them."""
    size = 0
    for i in range(count):
        if pushing[i] != 0:
            column = 0
            for j in range(i + 1):
                if pushing[j] != 0:
                    system[size, column] = products[i, j]
                    column += 1
            system[size, size] += regular
            left[size] = 1.0
            size += 1
    factorise(system, size)
    substitute(system, size, left)
    size = 0
    for i in range(count):
        push[i] = 0.0
        if pushing[i] != 0:
            push[i] = left[size]
            size += 1
    wrong = 0
    for i in range(count):
        pull = -1.0
        if pushing[i] != 0:
            pull = push[i]
        else:
            for j in range(count):
                pull += products[i, j] * push[j]
        left[i] = pull
        wrong += pull < -_ROUNDING
    return wrong


@compiled(Nothing, Dense, Count, Number, OutRow, OutPlaces, OutDense, OutRow)
def place_pushes(
    products: FloatArray,
    count: int,
    regular: float,
    push: FloatArray,
    pushing: IntArray,
    system: FloatArray,
    left: FloatArray,
) -> None:
    """Write the w >= 0 (count,) that minimises w'(P + r I) w / 2 - sum w.

    Block principal pivoting (Judice & Pires, 1994): all rows taken wrongly change sides, and where
    that has not helped three times in a row only the last of them, which ends in any case.

    Args:
        products: P (count, count), positive semi-definite.
        count: how many rows there are.
        regular: r > 0.
        push: result (count,).
        pushing, system, left: memory (count,), (count, count), (count,).
    """
    for i in range(count):
        pushing[i] = 1
    fewest, patience = count + 1, 3
    for _ in range(20 * (count + 1)):
        wrong = _correct(products, count, push, pushing, regular, system, left)
        if wrong == 0:
            break
        if wrong < fewest:
            fewest, patience = wrong, 3
        elif patience > 0:
            patience -= 1
        last = patience == 0 and wrong >= fewest
        for i in range(count - 1, -1, -1):
            if left[i] < -_ROUNDING:
                pushing[i] = 1 - pushing[i]
                if last:
                    break


FINDING = OutPlaces, OutDense, OutDense, OutDense, OutRow, OutRow, OutPlaces


@compiled(Count, OutDense, Count, Count, Dense, Count, Number, *FINDING)
def find_implied(
    binding: FloatArray,
    known: int,
    count: int,
    kept: FloatArray,
    equalities: int,
    narrow: float,
    places: IntArray,
    free: FloatArray,
    products: FloatArray,
    system: FloatArray,
    push: FloatArray,
    left: FloatArray,
    pushing: IntArray,
) -> int:
    """Move rows that no motion within the equalities leaves behind the known ones.

    With u_i what the equalities leave of row i, the direction d that minimises

        |d|^2 / 2 + sum s_i^2 / (2 r),      u_i d <= s_i - 1

    lets go of every row that can be let go of, with s_i near zero; of the others, which add up to
    nothing with positive weights, s_i is one. In between a wedge of half an angle a has
    s = r / (2 a^2 + r): `narrow` = sqrt(r / 2) is the half angle below which it counts as closed.
    The multipliers w of the rows solve the problem of `place_pushes`, and s = r w.

    Args:
        binding: rows of length one, outwards (>= count, n); result.
        known: how many in front are known to be implied, and among the equalities.
        count: how many there are.
        kept: orthonormal rows of the equalities (.., n).
        equalities: how many there are.
        narrow: half an angle [rad].
        places: numbers of the rows (count,); result.
        free, products, system, push, left, pushing: memory (count, n), twice (count, count) and
            three times (count,).

    Returns:
        how many are known now.
    """
    n, size = binding.shape[1], count - known
    regular = 2.0 * narrow**2
    for i in range(size):
        for j in range(n):
            free[i, j] = binding[known + i, j]
        remove(kept, equalities, free, i)
        remove(kept, equalities, free, i)
        for k in range(i + 1):
            product = 0.0
            for j in range(n):
                product += free[i, j] * free[k, j]
            products[i, k] = products[k, i] = product
    place_pushes(products, size, regular, push, pushing, system, left)
    found = known
    for i in range(known, count):
        if regular * push[i - known] > _HALF:
            for j in range(n):
                binding[found, j], binding[i, j] = binding[i, j], binding[found, j]
            places[found], places[i] = places[i], places[found]
            found += 1
    return found
