"""A whole solve of the controller's own solver in one call, compiled."""

from __future__ import annotations

from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Count, Number, OutPlaces, OutRow, Row, compiled
from wbc.control.solvers.budget import ROUNDS
from wbc.control.solvers.dual_steps import SOLVED, UNMET, climb_fixed
from wbc.control.solvers.row_system import place_blocks_fixed, settle_fixed
from wbc.fixed_arrays import FixedTable, array_at


@compiled(
    types.UniTuple(Count, 5),
    *(FixedTable, FixedTable, *[Number] * 2, *[Count] * 4, *[OutRow] * 3),
)
def solve_fixed(
    system: IntArray,
    climbing: IntArray,
    tolerance: float,
    allowed: float,
    most: int,
    starts_over: int,
    soft: int,
    skipped: int,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
) -> tuple[int, int, int, int, int]:
    """Settle from the last binding rows, else climb and settle from there.

    Where that fails no row counts as binding for the next time.

    Args:
        system, climbing: memory of SYSTEM and CLIMB.
        tolerance, allowed: as for `settle`.
        most: multiplications of a climb.
        starts_over: 1 where the rows that bound the last solution are not tried.
        soft: how many rows of the program are soft.
        skipped: bounds that the program leaves out, whose multipliers lead z.
        x: result (n,), what was reached where it is not SOLVED.
        y, z: results (e,), (skipped + r,) where it is, as in `QPSolution`.

    Returns:
        SOLVED, CONTRADICTION, UNFINISHED or UNMET; systems solved before and after the climb;
        multiplications of that; the row that contradicts others, -1 where none does.
    """
    base = len(array_at(system, 1, Row))
    taken = array_at(system, 16, OutPlaces)
    size, before, after, known, work = -1, 0, 0, 0, 0
    if starts_over == 0:
        size, before, known = settle_fixed(system, tolerance, allowed, ROUNDS, 0, x)
    else:
        place_blocks_fixed(system)
    if size < 0:
        ended, work, blocking = climb_fixed(
            climbing, known, base, allowed, 0.5 * tolerance, most, x
        )
        if ended == SOLVED:
            known = base - base % 2
            size, after, known = settle_fixed(system, tolerance, allowed, ROUNDS, known, x)
            ended = SOLVED if size >= 0 else UNMET
        if ended != SOLVED:
            taken[:] = 0
            return ended, before, after, work, blocking
    force, active = array_at(system, 13, OutRow), array_at(system, 15, OutPlaces)
    for i in range(soft, base):
        y[i - soft] = -force[i]
    z[:] = 0.0
    for i in range(base, size):
        z[skipped + active[i - base]] = -force[i]
    return SOLVED, before, after, work, -1
