"""Semi-smooth Newton iteration on the branches of the rows: the fast path."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Count, Dense, Flag, Nothing, Number, OutRow, Row, compiled
from wbc.sim.solve.branches import pieces_at, solve_pieces
from wbc.sim.solve.in_velocities import solve_in_velocities
from wbc.sim.solve.reduced import Reduced

_FULL_STEPS = 20
"""Solo12 in stance needs up to 5, a robot on 20 feet that rock 13. Of 1600 dense steps (corpora of
tests/sim/step/test_cones.py) 907, 1348, 1412 and 1474 settle within 6, 15, 20 and 30; proximal
rounds for the others included, all took 46 900, 30 500, 28 300 and 28 400 linear systems."""
_SHORTEST = 1e-2


@compiled(Nothing, Dense, Row, Row, OutRow, counted=False)
def speeds_at(
    delassus: FloatArray, free: FloatArray, impulse: FloatArray, speed: FloatArray
) -> None:
    """Write free + delassus @ impulse (r,)."""
    for i in range(len(free)):
        total = 0.0
        for j in range(len(free)):
            total += delassus[i, j] * impulse[j]
        speed[i] = free[i] + total


@compiled(Flag, Dense, Dense, Row, Row, Row, Count, Dense, Dense, Row, OutRow, counted=False)
def solve_smaller(
    ways: FloatArray,
    delassus: FloatArray,
    spring: FloatArray,
    slope: FloatArray,
    frictions: FloatArray,
    tangents: int,
    pieces: FloatArray,
    sliding: FloatArray,
    impulse: FloatArray,
    solved: FloatArray,
) -> bool:
    """Solve the pieces in velocities where W' is given (not empty), else in impulses."""
    if len(ways):
        return solve_in_velocities(
            ways, spring, slope, frictions, tangents, pieces, sliding, impulse, solved
        )
    return solve_pieces(
        delassus, spring, slope, frictions, tangents, pieces, sliding, impulse, solved
    )


@compiled(
    Count, Dense, Dense, Row, Row, Row, Dense, Row, Row, Count, Row, Number, Count, OutRow
)  # fmt: skip
def newton_loop(
    ways: FloatArray,
    delassus: FloatArray,
    free: FloatArray,
    spring: FloatArray,
    slope: FloatArray,
    laws: FloatArray,
    targets: FloatArray,
    frictions: FloatArray,
    tangents: int,
    start: FloatArray,
    tolerance: float,
    limit: int,
    impulse: FloatArray,
) -> int:
    """Write the row impulses (r,) at which every row is on its law; see `newton`.

    With W' (r, n) in `ways`, W'W = delassus, its systems are solved in velocities; (0, 0) for none.

    Returns:
        the number of linear systems solved, as a negative number where it did not converge (less
        one, so that it is never zero).
    """
    size = len(free)
    pieces, sliding = np.empty((size, 4)), np.empty((len(frictions), 3))
    speed, aim, trial = np.empty(size), np.empty(size), np.empty(size)
    impulse[:] = start
    speeds_at(delassus, free, impulse, speed)
    pieces_at(laws, targets, frictions, tangents, slope, impulse, speed, pieces, sliding)
    for iteration in range(1, _FULL_STEPS + 1):
        if not solve_smaller(
            ways, delassus, spring, slope, frictions, tangents, pieces, sliding, impulse, aim
        ):
            impulse[:] = start
            return -iteration - 1
        impulse[:] = aim
        speeds_at(delassus, free, impulse, speed)
        worst = pieces_at(
            laws, targets, frictions, tangents, slope, impulse, speed, pieces, sliding
        )
        if worst <= tolerance:
            return iteration
    # Full steps did not settle: shorten them until the residual falls.
    impulse[:] = start
    speeds_at(delassus, free, impulse, speed)
    pieces_at(laws, targets, frictions, tangents, slope, impulse, speed, pieces, sliding)
    merit = 0.0
    for i in range(size):
        merit += pieces[i, 3] * pieces[i, 3]
    for iteration in range(1, limit + 1):
        if not solve_smaller(
            ways, delassus, spring, slope, frictions, tangents, pieces, sliding, impulse, aim
        ):
            return -iteration - _FULL_STEPS - 1
        share = 1.0
        while True:
            for i in range(size):
                trial[i] = impulse[i] + share * (aim[i] - impulse[i])
            speeds_at(delassus, free, trial, speed)
            worst = pieces_at(
                laws, targets, frictions, tangents, slope, trial, speed, pieces, sliding
            )
            lower = 0.0
            for i in range(size):
                lower += pieces[i, 3] * pieces[i, 3]
            if lower < merit * (1.0 - 1e-3 * share) or share < _SHORTEST:
                break
            share *= 0.5
        impulse[:] = trial
        merit = lower
        if worst <= tolerance:
            return iteration + _FULL_STEPS
    return -limit - _FULL_STEPS - 1


def newton(
    reduced: Reduced, start: FloatArray, tolerance: float, limit: int
) -> tuple[FloatArray, int, bool]:
    """Iterate from row impulses `start` (r,) until every row is on its law.

    Full steps first: with the right branches, which warm starting usually has, one step is exact.
    Where they do not settle, at most `limit` steps follow that are shortened until the residual
    falls.

    Returns:
        the row impulses, the number of linear systems solved, and whether it converged.
    """
    if len(start) == 0:
        return start, 0, True
    impulse = np.empty(len(start))
    used = newton_loop(
        reduced.ways,
        reduced.delassus,
        reduced.free,
        reduced.spring,
        reduced.slope,
        reduced.laws,
        reduced.targets,
        reduced.frictions,
        reduced.tangents,
        start,
        tolerance,
        limit,
        impulse,
    )
    return impulse, used if used > 0 else -used - 1, used > 0
