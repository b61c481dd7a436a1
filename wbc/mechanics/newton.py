"""Solving the rows of a step: Newton on the pieces of their laws; where that fails, harder ways.

Semi-smooth Newton with full steps is exact in one step once the pieces are the right ones, which
those of the step before usually are. Steps that more rigid rows than freedoms (two flat feet, stuck
gears) make singular are solved with a little compliance in every row about the last iterate, which
carries nothing at the fixed point (proximal points). Sweeps over single rows always go downhill;
they find the pieces where both others turn in circles.
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
    branch_of,
    pieces_at,
    solve_pieces,
)

NEWTON, PROXIMAL, SWEEPS, UNSOLVED = range(4)
"""What found a solution, or that nothing did."""

WAYS = ("newton", "proximal", "sweeps")
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
_SWEEPS = 160
_NEAR = 1e3
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
        system.laws, system.targets, system.frictions, system.tangents,
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


@compiled(Nothing, SYSTEM, OutRow, counted=False)
def sweep(system: RowSystem, impulse: FloatArray) -> None:
    """Change row impulses (r,) one by one (non-smooth Gauss-Seidel).

    An element or a normal is solved exactly with all others held; a contact's tangents by one
    projection onto the disc that its normal impulse allows.
    """
    delassus, slope, tangents = system.delassus, system.slope, system.tangents
    m, count, contacts = len(system.laws), len(system.targets), len(system.frictions)
    size = len(impulse)
    for i in range(m + count):
        speed = system.free[i]
        for j in range(size):
            speed += delassus[i, j] * impulse[j]
        if i < m:
            law, own = system.laws[i], delassus[i, i]
            line = 1.0 / own if own > 0.0 else slope[i]
            point = -line * (speed - own * impulse[i])
            if law[7] < np.inf:
                point = (law[7] * point + line * law[8]) / (law[7] + line)
                line *= law[7] / (law[7] + line)
            sign, gain, bring = branch_of(law, point, line)
            impulse[i] = point
            if sign != 0.0:
                total = law[2] + gain * (law[6] + line)
                impulse[i] += line * (bring - gain * (point + sign * law[5])) / total
            continue
        impulse[i] = max(impulse[i] - slope[i] * (speed - system.targets[i - m]), 0.0)
        contact = i - m - count + contacts
        if contact < 0:
            continue
        first, length = m + count + contact * tangents, 0.0
        for a in range(first, first + tangents):
            slip = system.free[a]
            for j in range(size):
                slip += delassus[a, j] * impulse[j]
            impulse[a] -= slope[a] * slip
            length += impulse[a] * impulse[a]
        bound = system.frictions[contact] * impulse[i]
        if length > bound * bound:
            for a in range(first, first + tangents):
                impulse[a] *= bound / np.sqrt(length)


@compiled(several(Count, Count), SYSTEM, Row, Number, Number, OutRow)
def solve_system(
    system: RowSystem, start: FloatArray, tolerance: float, work: float, impulse: FloatArray
) -> tuple[int, int]:
    """Write the row impulses (r,) at which every row is on its law.

    Args:
        system: of the rows.
        start: (r,) impulses of the step before, or zeros.
        tolerance: largest accepted residual.
        work: share of `_WORK` beyond which nothing more is tried.
        impulse: to write; where nothing is found, the nearest.

    Returns:
        the number of linear systems solved, and NEWTON to UNSOLVED.
    """
    size = len(start)
    if size == 0:
        return 0, NEWTON
    # With more rows than freedoms shortened steps crawl along directions that move nothing.
    limit = 0 if size > len(system.half) else 12
    used = newton(system, start, tolerance, limit, impulse)
    if used > 0:
        return used, NEWTON
    used, none, most = -used - 1, np.zeros(size), int(work * _WORK / size**3)
    # The last step's pieces lead astray: start from none.
    count = newton(system, none, tolerance, limit, impulse)
    used += abs(count)
    if count > 0:
        return used, NEWTON
    good = 0.0
    for i in range(size):
        good += system.free[i] + system.delassus[i, i]
    if not np.isfinite(good):
        return used, UNSOLVED
    for fresh in range(2):
        count = proximal(system, none if fresh else start, tolerance, most - used, impulse)
        used += abs(count)
        if count > 0:
            return used, PROXIMAL
    swept, nearest, least = np.zeros(size), np.zeros(size), np.inf
    done, aim = 0, 5
    while aim <= _SWEEPS and (used <= most or done == 0):
        while done < aim:
            sweep(system, swept)
            done += 1
        aim *= 2
        for way in range(2):
            if way == 0:
                count = newton(system, swept, tolerance, 15, impulse)
            else:
                count = proximal(system, swept, tolerance, most - used, impulse)
            used += abs(count)
            if count > 0:
                return used, SWEEPS
        off = distance(system, swept)
        if off < least:
            least = off
            nearest[:] = swept
    impulse[:] = nearest
    return used, SWEEPS if least <= _NEAR * tolerance else UNSOLVED


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
