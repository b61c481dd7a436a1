"""The dual active-set method of Goldfarb & Idnani (1983) on a program in blocks, compiled."""

from __future__ import annotations

from math import sqrt

from numba import types

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
from wbc.control.solvers.dual_direction import multiply, place_direction, subtract_rows
from wbc.control.solvers.positive_definite import invert_factor
from wbc.control.solvers.row_system import meet_rows
from wbc.fixed_arrays import FixedTable, array_at

SOLVED, CONTRADICTION, UNFINISHED, UNMET = 0, 1, 2, 3
_CALL = 1400  # multiplications that a step takes as long as on a program without rows: 0.35 us
# Below these shares of a squared length a row is one that the equalities or the active rows already
# decide: well above what rounding leaves of a length (1e-16), squared.
_DECIDED, _DEPENDENT = 1e-18, 1e-12


@compiled(Number, Dense, Count, OutRow, OutRow, OutRow)
def project(
    basis: FloatArray, count: int, rest: FloatArray, along: FloatArray, part: FloatArray
) -> float:
    """Take `count` orthonormal rows out of `rest`; return what is left of it, squared.

    A second time where less than half is left (twice is enough: Giraud & others, 2005).
    `along` (count,) gets the components taken out; `part` (count,) is memory.
    """
    length = len(rest)
    before = 0.0
    for j in range(length):
        before += rest[j] * rest[j]
    for i in range(count):
        along[i] = 0.0
    total = before
    for _ in range(2):
        multiply(basis, count, rest, part)
        for i in range(count):
            along[i] += part[i]
        subtract_rows(basis, count, part, rest)
        total = 0.0
        for j in range(length):
            total += rest[j] * rest[j]
        if total > 0.5 * before:
            return total
    return total


@compiled(Nothing, OutDense, OutDense, OutDense, OutRow, OutPlaces, Count, Count)
def drop(
    basis: FloatArray,
    triangle: FloatArray,
    moves: FloatArray,
    push: FloatArray,
    active: IntArray,
    count: int,
    place: int,
) -> None:
    """Take one of `count` active rows away and turn basis and triangle back into shape."""
    length = basis.shape[1]
    for i in range(place, count - 1):
        push[i], active[i] = push[i + 1], active[i + 1]
        for j in range(moves.shape[1]):
            moves[i, j] = moves[i + 1, j]
        for k in range(count):
            triangle[k, i] = triangle[k, i + 1]
    for i in range(place, count - 1):
        a, b = triangle[i, i], triangle[i + 1, i]
        size = sqrt(a * a + b * b)
        if size > 0.0:
            c, s = a / size, b / size
            for k in range(i, count - 1):
                up, low = triangle[i, k], triangle[i + 1, k]
                triangle[i, k], triangle[i + 1, k] = c * up + s * low, c * low - s * up
            for j in range(length):
                up, low = basis[i, j], basis[i + 1, j]
                basis[i, j], basis[i + 1, j] = c * up + s * low, c * low - s * up


@compiled(
    types.UniTuple(Count, 2),
    *(Dense, Row, Row, Row, Number, OutPlaces, Row, OutRow),
)
def most_violated(
    C: FloatArray,
    x: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    reach: float,
    taken: IntArray,
    scales: FloatArray,
    values: FloatArray,
) -> tuple[int, int]:
    """Return the row furthest beyond a bound for its size, -1 if none, and which bound.

    The bound is +1 for the upper, -1 for the lower one.

    Args:
        C, lower, upper: rows (r, n) and bounds (r,).
        x: (n,).
        reach: how far beyond its bound a row may be.
        taken: (r,) other than 0 for rows that are active.
        scales: (r,) what violations are compared by.
        values: result C x (r,).
    """
    multiply(C, len(values), x, values)
    best, side, worst = -1, 0, 0.0
    for i in range(len(values)):
        if taken[i] == 0:
            above, below = values[i] - upper[i], lower[i] - values[i]
            if above > reach and scales[i] * above > worst:
                best, side, worst = i, 1, scales[i] * above
            if below > reach and scales[i] * below > worst:
                best, side, worst = i, -1, scales[i] * below
    return best, side


@compiled(Count, Row, Row, Count)
def first_to_leave(push: FloatArray, fall: FloatArray, count: int) -> int:
    """Return which push (count,) reaches zero first when they fall at rates `fall`; -1 if none."""
    best, shortest, largest = -1, 0.0, 0.0
    for i in range(count):
        largest = max(largest, abs(fall[i]))
    for i in range(count):
        if fall[i] > 1e-12 * largest:
            share = push[i] / fall[i]
            if best < 0 or share < shortest:
                best, shortest = i, share
    return best


@compiled(
    types.UniTuple(Count, 3),
    *(Dense, Row, Row, Dense, Count, Dense, Row, Row, Number, Count),
    *(OutRow, OutPlaces, OutPlaces, OutRow, *[OutDense] * 7),
)
def climb(
    G: FloatArray,
    softness: FloatArray,
    inverse: FloatArray,
    factor: FloatArray,
    size: int,
    C: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    tolerance: float,
    most: int,
    x: FloatArray,
    active: IntArray,
    taken: IntArray,
    push: FloatArray,
    basis: FloatArray,
    triangle: FloatArray,
    moves: FloatArray,
    memory: FloatArray,
    root: FloatArray,
    across: FloatArray,
    turned: FloatArray,
) -> tuple[int, int, int]:
    """Add violated rows one by one from the optimum without inequalities, dropping what pulls.

    Every step raises the least cost that the rows met so far allow, so that no set of rows comes
    back and the method ends; a row that can be met only by pulling at others is a contradiction.

    Args:
        G, softness, inverse, size: as for `place_direction`.
        factor: of K = G D^-1 G' + S, from `factorise`.
        C, lower, upper: inequalities (r, n), (r,).
        tolerance: how far beyond its bound a row may be.
        most: multiplications after which it stops.
        x: (n,) optimum without inequalities; result.
        active: result (.., ), rows that bind.
        taken: result (r,), +1 upper bound, -1 lower bound, 0 does not bind.
        push: result (..,), how hard each active row pushes, >= 0.
        basis, triangle, moves, memory: (.., n + size), (.., ..), (.., n), (11, n + size or r).
        root, across, turned: memory of `place_direction`.

    Returns:
        SOLVED, CONTRADICTION or UNFINISHED; multiplications; the row that failed, -1 where none.
    """
    n, room, count = len(x), len(push), 0
    along, fall, w, left = memory[0], memory[1], memory[2], memory[3]
    rest, z, row, values = memory[4], memory[5], memory[6], memory[7, : len(lower)]
    taken[:] = 0
    invert_factor(factor, size, root, across)
    for j in range(n):
        for i in range(size):
            turned[j, i] = G[i, j]
    roots = memory[8]
    for j in range(n):
        roots[j] = 1.0 / sqrt(inverse[j])
    for i in range(size):
        roots[n + i] = sqrt(softness[i])
    scales, half = memory[9, : len(lower)], memory[10]
    for i in range(len(lower)):
        length = 0.0
        for j in range(n):
            length += C[i, j] * C[i, j] * inverse[j]
        scales[i] = 1.0 / sqrt(length) if length > 0.0 else 1.0
    chosen, side, fresh = -1, 0, True
    # a new row takes its direction and a look at all rows; each row that binds takes a projection,
    # twice and half of the times twice more, and its share of the move
    work, of_row, of_bound = 0, 2 * size * (2 * n + size) + len(lower) * n, 3 * (n + size) + n
    gap, own, free_size, whole = 0.0, 0.0, 0.0, 0.0
    while work < most:
        work += _CALL + count * (of_bound + count // 2)
        if fresh:
            work += of_row
            chosen, side = most_violated(C, x, lower, upper, tolerance, taken, scales, values)
            if chosen < 0:
                return SOLVED, work, -1
            whole = 0.0
            for j in range(n):
                row[j] = side * C[chosen, j]
                whole += row[j] * inverse[j] * row[j]
            gap = values[chosen] - upper[chosen] if side > 0 else lower[chosen] - values[chosen]
            own, fresh = 0.0, False
            place_direction(
                G, turned, softness, inverse, root, across, size, row[:n], w, z[:n], left, rest
            )
        own_size = 0.0
        for j in range(n):
            rest[j] = z[j] * roots[j]
            own_size += rest[j] * rest[j]
        for i in range(size):
            rest[n + i] = w[i] * roots[n + i]
            own_size += rest[n + i] * rest[n + i]
        free_size = project(basis, count, rest[: n + size], along, half)
        free = free_size > _DECIDED * whole and free_size > _DEPENDENT * own_size
        for i in range(count - 1, -1, -1):
            value = along[i]
            for k in range(i + 1, count):
                value -= triangle[i, k] * fall[k]
            fall[i] = value / triangle[i, i]
        leaving = first_to_leave(push, fall, count)
        if leaving < 0 and not free:
            return CONTRADICTION, work, chosen
        share = gap / free_size if free else 0.0
        leaves = leaving >= 0 and (not free or push[leaving] / fall[leaving] < share)
        if leaves:
            share = push[leaving] / fall[leaving]
        own += share
        for i in range(count):
            push[i] -= share * fall[i]
        if free:
            gap -= share * free_size
            for j in range(n):
                x[j] -= share * z[j]
            for i in range(count):
                half[i] = -share * fall[i]
            subtract_rows(moves, count, half, x)
        if leaves:
            taken[active[leaving]] = 0
            drop(basis, triangle, moves, push, active, count, leaving)
            count -= 1
            continue
        if count == room:
            return UNFINISHED, work, -1
        scale = 1.0 / sqrt(free_size)
        for j in range(n + size):
            basis[count, j] = scale * rest[j]
        for i in range(count):
            triangle[i, count] = along[i]
            triangle[count, i] = 0.0
        triangle[count, count] = sqrt(free_size)
        for j in range(n):
            moves[count, j] = z[j]
        push[count], active[count], taken[chosen], fresh = own, chosen, side, True
        count += 1
    return UNFINISHED, work, -1


CLIMB = (
    *(Dense, Row, Row, OutDense, OutRow, OutRow, OutRow, OutRow),
    *(OutRow, OutDense, OutDense, OutRow, OutPlaces, OutPlaces),
    *(OutRow, *[OutDense] * 7),
)
"""Kinds of what `climb_fixed` needs.

C, lower, upper; the rows G, right, softness, inverse, free as `place_blocks` leaves them; force,
scaled, system, left, active, taken; and the memory of `climb`.
"""


@compiled(types.UniTuple(Count, 3), FixedTable, Count, Count, Number, Number, Count, OutRow)
def climb_fixed(
    memory: IntArray,
    known: int,
    size: int,
    allowed: float,
    tolerance: float,
    most: int,
    x: FloatArray,
) -> tuple[int, int, int]:
    """Find the optimum without inequalities, and `climb` from it, in the memory of CLIMB.

    Args:
        memory: where the arrays lie.
        known, size, allowed: as for `meet_rows`.
        tolerance, most: as for `climb`.
        x: result (n,).

    Returns:
        as `climb`; UNMET without any where the rows depend on one another.
    """
    G, softness, inverse = (
        array_at(memory, 3, OutDense),
        array_at(memory, 5, OutRow),
        array_at(memory, 6, OutRow),
    )
    system = array_at(memory, 10, OutDense)
    if not meet_rows(
        G,
        array_at(memory, 4, OutRow),
        softness,
        inverse,
        array_at(memory, 7, OutRow),
        known,
        size,
        allowed,
        x,
        array_at(memory, 8, OutRow),
        array_at(memory, 9, OutDense),
        system,
        array_at(memory, 11, OutRow),
    ):
        return UNMET, 0, -1
    return climb(
        G,
        softness,
        inverse,
        system,
        size,
        array_at(memory, 0, Dense),
        array_at(memory, 1, Row),
        array_at(memory, 2, Row),
        tolerance,
        most,
        x,
        array_at(memory, 12, OutPlaces),
        array_at(memory, 13, OutPlaces),
        array_at(memory, 14, OutRow),
        array_at(memory, 15, OutDense),
        array_at(memory, 16, OutDense),
        array_at(memory, 17, OutDense),
        array_at(memory, 18, OutDense),
        array_at(memory, 19, OutDense),
        array_at(memory, 20, OutDense),
        array_at(memory, 21, OutDense),
    )
