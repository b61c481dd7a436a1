"""The small linear system that a guess at the binding constraints leaves, compiled."""

from __future__ import annotations

from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutPlaces,
    OutRow,
    Row,
    compiled,
)
from wbc.control.solvers.positive_definite import factorise_from, substitute
from wbc.fixed_arrays import FixedTable, array_at

_SOLVES = 4  # two suffice but where rows all but repeat each other


@compiled(
    Flag,
    *(Dense, Row, Row, Row, Row, Count, Count, Number),
    *(OutRow, OutRow, OutDense, OutDense, OutRow),
)
def meet_rows(
    G: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    inverse: FloatArray,
    free: FloatArray,
    known: int,
    size: int,
    allowed: float,
    x: FloatArray,
    force: FloatArray,
    scaled: FloatArray,
    system: FloatArray,
    left: FloatArray,
) -> bool:
    """Solve (G D^-1 G' + S) force = right - G free for x = free + D^-1 G' force, and check it.

    Args:
        G, right, softness: rows (.., n), (..,) and the diagonal S, of which `size` count.
        inverse: diagonal of D^-1 (n,).
        free: x without any row (n,).
        known: rows, an even number, of which `scaled` and `system` know from an earlier call.
        size: number of rows.
        allowed: greatest sum of squares of what the rows may miss.
        x, force: results (n,), (..,).
        scaled, system, left: memory (.., n), (.., ..), (..,).

    Returns:
        whether the rows are met; they are not where they depend on one another.
    """
    n = len(x)
    for i in range(known):
        missing = right[i]
        for j in range(n):
            missing -= G[i, j] * free[j]
        force[i], left[i] = 0.0, missing
    for i in range(known, size):
        missing = right[i]
        for j in range(n):
            scaled[i, j] = G[i, j] * inverse[j]
            missing -= G[i, j] * free[j]
        force[i], left[i] = 0.0, missing
        for k in range(i + 1):
            product = 0.0
            for j in range(n):
                product += scaled[i, j] * G[k, j]
            system[i, k] = product
        system[i, i] += softness[i]
    if not factorise_from(system, known, size):
        return False
    x[:] = free
    for _ in range(_SOLVES):
        # x moves by corrections alone: summed anew from `force`, large terms that all but cancel
        # would leave 1e-16 of the largest, which is a thousand times what the rows may miss
        substitute(system, size, left)
        for i in range(size):
            force[i] += left[i]
            for j in range(n):
                x[j] += scaled[i, j] * left[i]
        total = 0.0
        for i in range(size):
            missing = right[i] - softness[i] * force[i]
            for j in range(n):
                missing -= G[i, j] * x[j]
            left[i] = missing
            total += missing * missing
        if total <= allowed:
            return True
    return False


@compiled(Nothing, *[Dense, *[Row] * 4, OutDense, *[OutRow] * 4])
def place_blocks(
    rows: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    diagonal: FloatArray,
    pull: FloatArray,
    G: FloatArray,
    all_right: FloatArray,
    all_softness: FloatArray,
    inverse: FloatArray,
    free: FloatArray,
) -> None:
    """Copy a program's rows (k, n) to the top of G, and write D^-1 and D^-1 pull (n,)."""
    for i in range(len(right)):
        all_right[i], all_softness[i] = right[i], softness[i]
        for j in range(len(pull)):
            G[i, j] = rows[i, j]
    for j in range(len(pull)):
        inverse[j] = 1.0 / diagonal[j]
        free[j] = inverse[j] * pull[j]


@compiled(Count, Dense, *[Row] * 2, Count, OutPlaces, OutPlaces, OutDense, *[OutRow] * 2)
def place_active(
    C: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    base: int,
    active: IntArray,
    taken: IntArray,
    G: FloatArray,
    right: FloatArray,
    softness: FloatArray,
) -> int:
    """Write the rows that bind below the first `base` rows of G.

    Args:
        C, lower, upper: inequalities (r, n), (r,).
        base: rows in front.
        active: result, the rows that bind.
        taken: (r,) +1 where the upper bound binds, -1 where the lower does, else 0.
        G, right, softness: results.

    Returns:
        how many rows there are, -1 where there is no room for them.
    """
    size = base
    for i in range(len(taken)):
        if taken[i] != 0:
            if size == len(right):
                return -1
            active[size - base] = i
            right[size] = upper[i] if taken[i] > 0 else lower[i]
            softness[size] = 0.0
            for j in range(G.shape[1]):
                G[size, j] = C[i, j]
            size += 1
    return size


@compiled(Count, *[Row] * 2, Number, *[Row] * 2, Count, Count, OutPlaces, OutPlaces)
def revise(
    lower: FloatArray,
    upper: FloatArray,
    tolerance: float,
    values: FloatArray,
    force: FloatArray,
    base: int,
    size: int,
    active: IntArray,
    taken: IntArray,
) -> int:
    """Let go of rows that pull and take rows that are violated; return how many changed.

    Args:
        lower, upper: bounds (r,).
        tolerance: how far beyond its bound a row may be, and a push below zero.
        values: C x (r,).
        force: of every row (.., ); a row that pushes from its upper bound has a negative one.
        base, size: where the rows that bind start and end in `force`.
        active, taken: as `place_active` left them; `taken` is the result.
    """
    changed = 0
    for i in range(len(taken)):
        if taken[i] == 0:
            if values[i] - upper[i] > tolerance:
                taken[i], changed = 1, changed + 1
            elif lower[i] - values[i] > tolerance:
                taken[i], changed = -1, changed + 1
    for k in range(size - base):
        # to drop what hardly pushes as well would drop and take some rows in turns
        if -force[base + k] * taken[active[k]] < -tolerance:
            taken[active[k]], changed = 0, changed + 1
    return changed


@compiled(Nothing, Dense, Row, OutRow)
def place_values(rows: FloatArray, x: FloatArray, values: FloatArray) -> None:
    """Write rows @ x (r,) into `values`."""
    for i in range(len(rows)):
        reached = 0.0
        for j in range(len(x)):
            reached += rows[i, j] * x[j]
        values[i] = reached


@compiled(
    types.UniTuple(Count, 3),
    *(Dense, *[Row] * 4, Dense, *[Row] * 2, Number, Number, Count, Count),
    *(OutDense, *[OutRow] * 7, OutPlaces, OutPlaces, OutDense, OutDense, OutRow),
)
def settle(
    rows: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    diagonal: FloatArray,
    pull: FloatArray,
    C: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    tolerance: float,
    allowed: float,
    rounds: int,
    known: int,
    G: FloatArray,
    all_right: FloatArray,
    all_softness: FloatArray,
    inverse: FloatArray,
    free: FloatArray,
    x: FloatArray,
    force: FloatArray,
    values: FloatArray,
    active: IntArray,
    taken: IntArray,
    scaled: FloatArray,
    system: FloatArray,
    left: FloatArray,
) -> tuple[int, int, int]:
    """Solve with the rows taken as binding, and correct these until nothing changes.

    One call for a whole tick where few rows bind: handing arrays over takes as long as the work.

    Args:
        rows, right, softness, diagonal, pull, C, lower, upper: of the program.
        tolerance, allowed: as for `revise` and `meet_rows`.
        rounds: systems solved at most.
        known: as for `meet_rows`; not 0 where the program is that of an earlier call.
        G, all_right, all_softness, inverse, free: results, as of `place_blocks`.
        x, force, values: results.
        active, taken: as for `revise`; `taken` is what to start from, and the result.
        scaled, system, left: memory of `meet_rows`.

    Returns:
        how many rows G has in the end, -1 where the rows do not settle; systems solved; `known`
        for the next call.
    """
    if known == 0:
        place_blocks(
            rows, right, softness, diagonal, pull, G, all_right, all_softness, inverse, free
        )
    base = len(right)
    freedoms, before = len(pull), len(taken)
    for i in range(base):
        if softness[i] == 0.0:
            freedoms -= 1
    for count in range(rounds):
        size = place_active(C, lower, upper, base, active, taken, G, all_right, all_softness)
        # more hard rows than variables depend on one another; of the starts that do not settle,
        # two thirds on Talos and Solo12 end so, on a system twice as large as a good one's
        if size < 0 or size - base > freedoms:
            return -1, count, known
        if not meet_rows(
            G,
            all_right,
            all_softness,
            inverse,
            free,
            known,
            size,
            allowed,
            x,
            force,
            scaled,
            system,
            left,
        ):
            return -1, count + 1, known
        known = base - base % 2
        place_values(C, x, values)
        changed = revise(lower, upper, tolerance, values, force, base, size, active, taken)
        if changed == 0:
            return size, count + 1, known
        if changed > before:  # 6 of 1572 hostile starts settle after that, and 422 do not
            return -1, count + 1, known
        before = changed
    return -1, rounds, known


SYSTEM = (
    *(Dense, Row, Row, Row, Row, Dense, Row, Row),
    *(OutDense, OutRow, OutRow, OutRow, OutRow, OutRow, OutRow),
    *(OutPlaces, OutPlaces, OutDense, OutDense, OutRow),
)
"""Kinds of the arrays of `settle` but x, in its order."""


@compiled(types.UniTuple(Count, 3), FixedTable, Number, Number, Count, Count, OutRow)
def settle_fixed(
    memory: IntArray, tolerance: float, allowed: float, rounds: int, known: int, x: FloatArray
) -> tuple[int, int, int]:
    """Do as `settle` does in the memory of SYSTEM."""
    return settle(
        array_at(memory, 0, Dense),
        array_at(memory, 1, Row),
        array_at(memory, 2, Row),
        array_at(memory, 3, Row),
        array_at(memory, 4, Row),
        array_at(memory, 5, Dense),
        array_at(memory, 6, Row),
        array_at(memory, 7, Row),
        tolerance,
        allowed,
        rounds,
        known,
        array_at(memory, 8, OutDense),
        array_at(memory, 9, OutRow),
        array_at(memory, 10, OutRow),
        array_at(memory, 11, OutRow),
        array_at(memory, 12, OutRow),
        x,
        array_at(memory, 13, OutRow),
        array_at(memory, 14, OutRow),
        array_at(memory, 15, OutPlaces),
        array_at(memory, 16, OutPlaces),
        array_at(memory, 17, OutDense),
        array_at(memory, 18, OutDense),
        array_at(memory, 19, OutRow),
    )


@compiled(Nothing, FixedTable)
def place_blocks_fixed(memory: IntArray) -> None:
    """Do as `place_blocks` does in the memory of SYSTEM."""
    place_blocks(
        array_at(memory, 0, Dense),
        array_at(memory, 1, Row),
        array_at(memory, 2, Row),
        array_at(memory, 3, Row),
        array_at(memory, 4, Row),
        array_at(memory, 8, OutDense),
        array_at(memory, 9, OutRow),
        array_at(memory, 10, OutRow),
        array_at(memory, 11, OutRow),
        array_at(memory, 12, OutRow),
    )


@compiled(Nothing, Row, Number, OutPlaces)
def place_pushing(z: FloatArray, least: float, taken: IntArray) -> None:
    """Write the signs (r,) of multipliers z (r,), 0 for those of size `least` or less."""
    for i in range(len(taken)):
        taken[i] = (1 if z[i] > 0.0 else -1) if abs(z[i]) > least else 0
