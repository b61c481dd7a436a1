"""Solving the rows of a step: Newton on the tangents of their laws; where that fails, softer rows.

Semi-smooth Newton with full steps is exact in one step once the tangents are the right ones, which
those of the step before usually are. Rows that hold give way a little about their last impulse
(proximal points), so that more of them than freedoms are no matter: a robot that lies on many
points, or stands while dry friction holds its joints. Where steps turn in circles, all rows get a
compliance about an impulse that stays while Newton's steps settle, and carry nothing by it at the
fixed point: each round that settles makes them harder, each that does not makes them softer. Where
that fails, too, friction gives way.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutRow, Row, compiled, inner
from wbc.mechanics.linear import add_all, add_times, copy_to, dot, rest_of_way
from wbc.mechanics.rows import Room, RowSystem, copied, room_for, tangents_at
from wbc.mechanics.tangents import follow_tangents, same_tangents, solve_tangents

NEWTON, PROXIMAL, RANGES, PASSIVE, UNSOLVED, SEVERAL = range(6)
"""What found a solution, that only a passive end was found, nothing, or several; for RANGES and
SEVERAL see `wbc.sim.step.self_locking`."""

WAYS = ("newton", "proximal", "ranges", "passive")
"""The same as words."""

TOLERANCE = 1e-10
"""Accepted distance of a row from its law, as a share of the largest speed or target plus 1.

A target below zero does not count: a row reaches it only at speeds that count already, and a
barrier that is kept in a short part has one that no speed comes near.
"""

_STEPS = 20
"""Solo12 in stance needs up to 6, TALOS 8, a robot on 20 feet that rock 13. Of 2,420 dense steps
(corpora of tests/sim/step/test_cones.py) 2,172 settle within 20 and 2,223 within 30, with `HOLD` at
1e-4."""

HOLD = 3e-5
"""Compliance of rows that hold, as a share of their own. TALOS that stands with dry friction at 30
joints, and that falls and comes to rest, takes 4.3 and 5.5 linear systems in a step with 1e-5, 4.5
and 6.2 with 3e-5, 5.3 and 5.8 with 1e-4, 8.9 and 6.0 with 1e-3. With 1e-5 one of the dense steps
above ends off its laws."""
_FIRM = 1e-9  # the same where laws fall: about points, steps then need not come nearer
_NEAR, _MEAN = 1e3, 10.0
"""Of the tolerance: what counts as a solution; and what rows may be off by where nothing comes
nearer, as a mean by what they carry: what they make of energy is rounding then
(`StepResult.events`)."""
_WEAKER, _EXACT = 5, 0.03
"""Times that friction is halved, but the last time, when there is none; and of the tolerance, what
a passive end is off the laws of that friction."""
_SOFTEST, _HARDEST, _FIRST = 100.0, 1e-9, 1e-3
_HARDER, _SOFTER, _PROXIMAL_ROUNDS = 0.3, 30.0, 60
"""Compliance of rounds, as a share of that of each row alone, and how it changes. Nine of
the dense steps above are not solved where rows get no softer than 1; all are from 30 on. Begun at
1e-6 or 1e-3, one takes 16.0 or 12.8 linear systems (mean)."""
_WORK = 1e8
"""Multiplications and additions, thrice as many, after which no other way is begun."""


@inner
def speeds_at(system: RowSystem, impulse: Row, x: OutRow, speed: OutRow) -> None:
    """Write x = ways' impulse (n,), and the speeds (r,) of the rows."""
    x[:] = 0.0
    add_all(impulse, system.ways, x)
    for i in range(len(speed)):
        speed[i] = system.free[i] + system.give[i] * impulse[i] + dot(x, system.ways[i])


@inner
def look_at(
    system: RowSystem, hold: float, impulse: Row, speed: OutRow, room: Room
) -> tuple[float, bool]:
    """Write the speeds and tangents at row impulses (r,); return what `tangents_at` does."""
    speeds_at(system, impulse, room.line, speed)
    return tangents_at(system, hold, impulse, speed, room)


@compiled
def tolerance_of(system: RowSystem) -> float:
    """Return the largest distance of a row from its law in a solution, as a speed."""
    fastest = 0.0
    for i in range(len(system.free)):
        fastest = max(fastest, abs(system.free[i]))
    for i in range(len(system.targets)):
        fastest = max(fastest, system.targets[i])
    return TOLERANCE * (1.0 + fastest)


@compiled
def residuals(system: RowSystem, impulse: Row, speed: OutRow, off: OutRow) -> float:
    """Write speeds and residuals (r,) at row impulses (r,); return the largest."""
    room = room_for(system)
    worst, _ = look_at(system, HOLD, impulse, speed, room)
    copy_to(room.off, off)
    return worst


@compiled(inside=True)
def distance(system: RowSystem, impulse: Row) -> float:
    """Return how far the row farthest from its law is at row impulses (r,), as a speed."""
    return residuals(system, impulse, np.empty(len(impulse)), np.empty(len(impulse)))


@compiled(inside=True)
def is_near(system: RowSystem, tolerance: float, impulse: Row) -> bool:
    """Return whether what rows at impulses (r,) are off their laws by makes rounding of work.

    So it may be where rows that hold contradict each other.
    """
    off, work, pushes = np.empty(len(impulse)), 0.0, 0.0
    worst = residuals(system, impulse, np.empty(len(impulse)), off)
    for i in range(len(impulse)):
        work += abs(off[i] * impulse[i])
        pushes += abs(impulse[i])
    return worst <= _NEAR * tolerance and work <= _MEAN * tolerance * pushes


@compiled(inside=True)
def newton(system: RowSystem, start: Row, tolerance: float, firm: bool, impulse: OutRow) -> int:
    """Write the row impulses (r,) at which every row is on its law, by Newton's steps.

    Args:
        system: of the rows.
        start: (r,).
        tolerance: largest accepted residual.
        firm: whether rows that hold hardly give way, as laws that fall and rows with a compliance
            of their own need; else steps may end near the laws where they come no nearer.
        impulse: to write.

    Returns:
        the number of linear systems solved, as a negative number where it did not converge.
    """
    speed, room, hold = np.empty(len(start)), room_for(system), _FIRM if firm else HOLD
    copy_to(start, impulse)
    least, one_sided = look_at(system, hold, impulse, speed, room)
    for iteration in range(1, _STEPS + 1):
        if not solve_tangents(system, one_sided, room, impulse):
            return -iteration
        follow_tangents(system, room, impulse)
        worst, one_sided = look_at(system, hold, impulse, speed, room)
        if worst <= tolerance:
            if same_tangents(room):
                solve_tangents(system, one_sided, room, impulse)
                follow_tangents(system, room, impulse)
            return iteration
        if not firm and worst > 0.5 * least and is_near(system, tolerance, impulse):
            return iteration
        least = min(least, worst)
    return -_STEPS


@compiled(inside=True)
def softened(system: RowSystem, compliance: float, about: Row) -> RowSystem:
    """Return the system with a compliance in every row, a share of its own, about `about` (r,)."""
    soft = copied(system)
    for i in range(len(about)):
        own = compliance * system.own[i]
        soft.give[i] += own
        soft.free[i] -= own * about[i]
        soft.slope[i] /= 1.0 + compliance
    return soft


@compiled(inside=True)
def proximal(system: RowSystem, start: Row, tolerance: float, most: int, impulse: OutRow) -> int:
    """Write the row impulses (r,) by proximal rounds, like `newton`.

    A split of forces that has to move far (a corner of a sole that must let go before the rest
    fits) moves by rounding errors over compliance per round: each round that Newton solves makes
    the rows harder, each that it does not makes them softer. No round begins after `most` linear
    systems.
    """
    used, compliance = 0, _FIRST
    copy_to(start, impulse)
    following = np.empty(len(start))
    for _ in range(_PROXIMAL_ROUNDS):
        soft = softened(system, compliance, impulse)
        count = newton(soft, impulse, tolerance, True, following)
        used += abs(count)
        if distance(system, following) <= tolerance:
            copy_to(following, impulse)
            return used
        if count > 0:
            copy_to(following, impulse)
            compliance = max(_HARDER * compliance, _HARDEST)
        else:
            compliance *= _SOFTER
        if compliance > _SOFTEST or used > most:
            break
    return -used - 1


@compiled(inside=True)
def solve_system(
    system: RowSystem, start: Row, tolerance: float, work: float, impulse: OutRow
) -> tuple[int, int]:
    """Write the row impulses (r,) at which every row is on its law.

    Where nothing leads to the laws, contacts get half the friction, and so on, and gears that lock
    themselves pass nothing back: a passive end.

    Args:
        system: of the rows.
        start: (r,) impulses of the step before, or zeros.
        tolerance: largest accepted residual.
        work: share of `_WORK` beyond which nothing more is tried; below one for what may fail, and
            has no passive end.
        impulse: to write.

    Returns:
        the number of linear systems solved, and what found them: PASSIVE ends miss some laws,
        and there is none where ground squeezes or nothing is a number.
    """
    size = len(start)
    if size == 0:
        return 0, NEWTON
    n, used, good, falls = system.ways.shape[1], 0, 0.0, False
    for i in range(len(system.laws)):
        falls = falls or system.laws[i, 4] < 0.0
    begin = start.copy()
    for fresh in range(2 if falls else 1):  # the last step's tangents may lead astray
        if fresh:
            begin[:] = 0.0
        count = newton(system, begin, tolerance, falls, impulse)
        used += abs(count)
        if count > 0:
            return used, NEWTON
    for i in range(size):
        good += system.free[i] + system.own[i]
    if not np.isfinite(good):
        return used, UNSOLVED
    copy_to(start, begin)
    most = int(work * _WORK / (n * n * (3 * size + n)))
    for fresh in range(2):
        if fresh:
            begin[:] = 0.0
        count = proximal(system, begin, tolerance, most, impulse)
        used += abs(count)
        if count > 0 or is_near(system, tolerance, impulse):
            return used, PROXIMAL
    weaker = copied(system)
    for i in range(len(system.laws)):
        weaker.laws[i, 4] = max(system.laws[i, 4], 0.0)
    for turn in range(_WEAKER if work >= 1.0 else 0):
        if turn or not falls:
            weaker.frictions[:] *= 0.5 if turn < _WEAKER - 1 else 0.0
        count = proximal(weaker, begin, _EXACT * tolerance, most, impulse)
        used += abs(count)
        if count > 0:
            return used, PASSIVE
    return used, UNSOLVED


@compiled(counted=False)
def velocity_after(system: RowSystem, lower: Dense, free: Row, impulse: Row, after: OutRow) -> None:
    """Write v (n,) after row impulses (r,).

    Args:
        system: of the rows.
        lower: L (n, n) with L' L = H_l.
        free: v (n,) without the rows.
        impulse: (r,).
        after: to write.
    """
    after[:] = 0.0
    add_all(impulse, system.ways, after)
    rest_of_way(lower, after)
    add_times(1.0, free, after)
