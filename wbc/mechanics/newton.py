"""Solving the rows of a step: Newton on the pieces of their laws; where that fails, harder ways.

Semi-smooth Newton with full steps is exact in one step once the pieces are the right ones, which
those of the step before usually are. Steps that more rigid rows than freedoms (two flat feet, stuck
gears) make singular are solved with a little compliance in every row about the last iterate, which
carries nothing at the fixed point (proximal points). Where both turn in circles, rounds with the
friction that the impulses before allow lead to the laws, or to a passive end near them.
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Row,
    compiled,
    several,
)
from wbc.mechanics.in_velocities import solve_in_velocities
from wbc.mechanics.rows import (
    SYSTEM,
    RowSystem,
    pieces_at,
    solve_pieces,
)

NEWTON, PROXIMAL, FRICTION, PASSIVE, UNSOLVED = range(5)
"""What found a solution, that only a passive end was found, or nothing."""

WAYS = ("newton", "proximal", "friction", "passive")
"""The same as words."""

_FULL_STEPS = 20
"""Solo12 in stance needs up to 5, a robot on 20 feet that rock 13. Of 1600 dense steps (corpora of
tests/sim/step/test_cones.py) 907, 1348, 1412 and 1474 settle within 6, 15, 20 and 30; proximal
rounds for the others included, all took 46 900, 30 500, 28 300 and 28 400 linear systems."""
_SHORTEST = 1e-2
_SOFTEST, _HARDEST, _FIRST = 1.0, 1e-9, 1e-6
_HARDER, _SOFTER = 0.3, 30.0
_ROUNDS = 60
_INNER = 10
_NEAR = 1e3
_FRICTION_ROUNDS, _PLAIN_ROUNDS, _PASSIVE_SYSTEMS = 40, 15, 100
_WORK = 1e8
"""Multiplications and additions, r^3 per linear system, after which no other way is begun."""


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


@compiled(Flag, SYSTEM, Dense, Dense, Row, OutRow, counted=False)
def solve_smaller(
    system: RowSystem,
    pieces: FloatArray,
    sliding: FloatArray,
    impulse: FloatArray,
    solved: FloatArray,
) -> bool:
    """Solve the pieces in velocities where the system has `ways`, else in impulses."""
    if len(system.ways):
        return solve_in_velocities(system, pieces, sliding, impulse, solved)
    return solve_pieces(system, pieces, sliding, impulse, solved)


@compiled(Number, SYSTEM, Row, OutRow, OutDense, OutDense, counted=False)
def look_at(
    system: RowSystem,
    impulse: FloatArray,
    speed: FloatArray,
    pieces: FloatArray,
    sliding: FloatArray,
) -> float:
    """Write the speeds and pieces at row impulses (r,); return the largest residual."""
    speeds_at(system.delassus, system.free, impulse, speed)
    return pieces_at(system, impulse, speed, pieces, sliding)


@compiled(Number, SYSTEM, Row)
def distance(system: RowSystem, impulse: FloatArray) -> float:
    """Return how far the row farthest from its law is at row impulses (r,), as a speed."""
    size = len(impulse)
    pieces, sliding = np.empty((size, 4)), np.empty((len(system.frictions), 3))
    return look_at(system, impulse, np.empty(size), pieces, sliding)


@compiled(Number, Dense, counted=False)
def merit_of(pieces: FloatArray) -> float:
    """Return the sum of the squares of the residuals."""
    merit = 0.0
    for i in range(len(pieces)):
        merit += pieces[i, 3] * pieces[i, 3]
    return merit


@compiled(Count, SYSTEM, Row, Number, Count, OutRow)
def newton(
    system: RowSystem, start: FloatArray, tolerance: float, limit: int, impulse: FloatArray
) -> int:
    """Write the row impulses (r,) at which every row is on its law.

    Full steps first: with the right pieces one step is exact. Where they do not settle, at most
    `limit` steps follow that are shortened until the residual falls.

    Args:
        system: of the rows.
        start: (r,).
        tolerance: largest accepted residual.
        limit: of shortened steps.
        impulse: to write.

    Returns:
        the number of linear systems solved, as a negative number where it did not converge (less
        one, so that it is never zero).
    """
    size = len(start)
    pieces, sliding = np.empty((size, 4)), np.empty((len(system.frictions), 3))
    speed, aim, trial = np.empty(size), np.empty(size), np.empty(size)
    impulse[:] = start
    look_at(system, impulse, speed, pieces, sliding)
    for iteration in range(1, _FULL_STEPS + 1):
        if not solve_smaller(system, pieces, sliding, impulse, aim):
            impulse[:] = start
            return -iteration - 1
        impulse[:] = aim
        if look_at(system, impulse, speed, pieces, sliding) <= tolerance:
            return iteration
    # Full steps did not settle: shorten them until the residual falls.
    impulse[:] = start
    look_at(system, impulse, speed, pieces, sliding)
    merit = merit_of(pieces)
    for iteration in range(1, limit + 1):
        if not solve_smaller(system, pieces, sliding, impulse, aim):
            return -iteration - _FULL_STEPS - 1
        share = 1.0
        while True:
            for i in range(size):
                trial[i] = impulse[i] + share * (aim[i] - impulse[i])
            worst = look_at(system, trial, speed, pieces, sliding)
            lower = merit_of(pieces)
            if lower < merit * (1.0 - 1e-3 * share) or share < _SHORTEST:
                break
            share *= 0.5
        impulse[:] = trial
        merit = lower
        if worst <= tolerance:
            return iteration + _FULL_STEPS
    return -limit - _FULL_STEPS - 1


@compiled(SYSTEM, SYSTEM, Number, Row)
def softened(system: RowSystem, compliance: float, about: FloatArray) -> RowSystem:
    """Return the system with a compliance in series with every row, unloaded at `about` (r,).

    It is a share of each row's own, 1/slope before tangents were paired.
    """
    size = len(about)
    delassus, free = system.delassus.copy(), system.free.copy()
    spring, slope = system.spring.copy(), system.slope.copy()
    for i in range(size):
        own = compliance * 1e9 * spring[i]
        delassus[i, i] += own
        free[i] -= own * about[i]
        spring[i] *= 1.0 + compliance
        slope[i] /= 1.0 + compliance
    return RowSystem(
        system.half, np.empty((0, 0)), delassus, free, spring, slope,
        system.laws, system.targets, system.frictions, system.grips, system.tangents,
    )  # fmt: skip


@compiled(Count, SYSTEM, Row, Number, Count, OutRow)
def proximal(
    system: RowSystem, start: FloatArray, tolerance: float, most: int, impulse: FloatArray
) -> int:
    """Write the row impulses (r,) by proximal rounds, like `newton`.

    A split of forces that has to move far (a corner of a sole that must let go before the rest
    fits) moves by rounding errors over compliance per round: each round that Newton solves makes
    the rows harder, each that it does not makes them softer. No round begins after `most` linear
    systems.
    """
    used, compliance = 0, _FIRST
    impulse[:] = start
    following = np.empty(len(start))
    for _ in range(_ROUNDS):
        count = newton(softened(system, compliance, impulse), impulse, tolerance, _INNER, following)
        used += abs(count)
        if distance(system, following) <= tolerance:
            impulse[:] = following
            return used
        if count > 0:
            impulse[:] = following
            compliance = max(_HARDER * compliance, _HARDEST)
        else:
            compliance *= _SOFTER
        if compliance > _SOFTEST or used > most:
            break
    return -used - 1


@compiled(several(Count, Count), SYSTEM, Row, Number, Count, OutRow)
def solve_plainly(
    system: RowSystem, start: FloatArray, tolerance: float, most: int, impulse: FloatArray
) -> tuple[int, int]:
    """Write row impulses (r,) by Newton's iteration, or proximal rounds; see `solve_system`."""
    # With more rows than freedoms shortened steps crawl along directions that move nothing.
    limit = 0 if len(start) > len(system.half) else 12
    used, none, good = newton(system, start, tolerance, limit, impulse), np.zeros(len(start)), 0.0
    if used > 0:
        return used, NEWTON
    used = -used - 1
    # The last step's pieces lead astray: start from none.
    count = newton(system, none, tolerance, limit, impulse)
    used += abs(count)
    if count > 0:
        return used, NEWTON
    for i in range(len(start)):
        good += system.free[i] + system.delassus[i, i]
    for fresh in range(2 if np.isfinite(good) else 0):
        count = proximal(system, none if fresh else start, tolerance, most - used, impulse)
        used += abs(count)
        if count > 0:
            return used, PROXIMAL
    return used, UNSOLVED


@compiled(several(Count, Count), SYSTEM, Row, Number, Number, OutRow)
def solve_system(
    system: RowSystem, start: FloatArray, tolerance: float, work: float, impulse: FloatArray
) -> tuple[int, int]:
    """Write the row impulses (r,) at which every row is on its law.

    Where Newton and proximal rounds fail, contacts get the friction that the impulses found so far
    allow, whatever they press then, and gears that lock themselves pass nothing back. That is a
    convex program, and every row of its solution takes energy. Rounds with the friction that each
    solution allows come nearer to the laws (Haslinger's iteration); where none meets them, the last
    one is a passive end.

    Args:
        system: of the rows.
        start: (r,) impulses of the step before, or zeros.
        tolerance: largest accepted residual.
        work: share of `_WORK` beyond which nothing more is tried; below one for what may fail, and
            has no such rounds.
        impulse: to write.

    Returns:
        the number of linear systems solved, and NEWTON to UNSOLVED: PASSIVE ends miss some laws,
        and there is none where ground squeezes or nothing is a number.
    """
    size = len(start)
    if size == 0:
        return 0, NEWTON
    most = int(work * _WORK / size**3)
    used, way = solve_plainly(system, start, tolerance, most, impulse)
    if way < UNSOLVED or work < 1.0:
        return used, way
    laws, grips = system.laws.copy(), np.zeros(len(system.frictions))
    first = len(laws) + len(system.targets) - len(grips)
    for i in range(len(laws)):
        laws[i, 4] = max(laws[i, 4], 0.0)
    convex = RowSystem(
        system.half, system.ways, system.delassus, system.free, system.spring, system.slope,
        laws, system.targets, np.zeros(len(grips)), grips, system.tangents,
    )  # fmt: skip
    found, passive, least = np.zeros(size), UNSOLVED, np.inf
    for turn in range(_FRICTION_ROUNDS):
        count, way = solve_plainly(convex, found, 0.1 * tolerance, _PASSIVE_SYSTEMS, impulse)
        used += count
        if way == UNSOLVED:
            break
        passive, found[:] = PASSIVE, impulse
        least = distance(system, found)
        if least > tolerance:
            count = newton(system, found, tolerance, 0, impulse)
            used += abs(count)
            if count > 0:
                return used, FRICTION
        if least <= tolerance or (turn > 0 and used > most):
            break
        for i in range(len(grips)):
            fresh = system.frictions[i] * max(found[first + i], 0.0)
            grips[i] = fresh if turn < _PLAIN_ROUNDS else 0.5 * (grips[i] + fresh)
    impulse[:] = found
    return used, FRICTION if least <= _NEAR * tolerance else passive


@compiled(Nothing, SYSTEM, Dense, Row, Row, OutRow, counted=False)
def velocity_after(
    system: RowSystem, lower: FloatArray, free: FloatArray, impulse: FloatArray, after: FloatArray
) -> None:
    """Write v (n,) after row impulses (r,).

    Args:
        system: of the rows.
        lower: L (n, n) with L' L = H_l.
        free: v (n,) without the rows.
        impulse: (r,).
        after: to write.
    """
    half = system.half
    for j in range(len(free)):
        total = 0.0
        for i in range(len(impulse)):
            total += half[j, i] * impulse[i]
        after[j] = total
    for i in range(len(free)):
        total = 0.0
        for j in range(i):
            total += lower[i, j] * after[j]
        after[i] = (after[i] - total) / lower[i, i]
    for j in range(len(free)):
        after[j] += free[j]
