"""A solution from the rows that bound the last one, or a few steps away, compiled."""

from __future__ import annotations

from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Count, Number, OutPlaces, OutRow, Row, compiled
from wbc.control.solvers.budget import ROUNDS
from wbc.control.solvers.dual_steps import SOLVED, climb_fixed
from wbc.control.solvers.row_system import settle_fixed
from wbc.fixed_arrays import FixedTable, array_at


@compiled(types.UniTuple(Count, 4), *[FixedTable] * 2, *[Number] * 2, *[Count] * 3, *[OutRow] * 3)
def guess_fixed(
    system: IntArray,
    climbing: IntArray,
    tolerance: float,
    allowed: float,
    most: int,
    soft: int,
    skipped: int,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
) -> tuple[int, int, int, int]:
    """Settle from the last binding rows, else climb shortly and settle from there.

    Where that fails no row counts as binding for the next time.

    Args:
        system, climbing: memory of SYSTEM and CLIMB.
        tolerance, allowed: as for `settle`.
        most: multiplications of a climb.
        soft: how many rows of the program are soft.
        skipped: bounds that the program leaves out, whose multipliers lead z.
        x, y, z: results (n,), (e,), (skipped + r,), as in `QPSolution`.

    Returns:
        how many rows G has in the end, -1 where the guess fails; systems solved before and after
        the climb; multiplications of that.
    """
    base = len(array_at(system, 1, Row))
    taken = array_at(system, 16, OutPlaces)
    size, before, known = settle_fixed(system, tolerance, allowed, ROUNDS, 0, x)
    after, work = 0, 0
    if size < 0:
        taken[:] = 0
        ended, work, _ = climb_fixed(climbing, known, base, allowed, 0.5 * tolerance, most, x)
        if ended == SOLVED:
            known = base - base % 2
            size, after, known = settle_fixed(system, tolerance, allowed, ROUNDS, known, x)
        if size < 0:
            taken[:] = 0
            return -1, before, after, work
    force, active = array_at(system, 13, OutRow), array_at(system, 15, OutPlaces)
    for i in range(soft, base):
        y[i - soft] = -force[i]
    z[:] = 0.0
    for i in range(base, size):
        z[skipped + active[i - base]] = -force[i]
    return size, before, after, work
