"""Solving the rows of a step: Newton on the tangents of their laws; where that fails, softer rows.

Semi-smooth Newton with full steps is exact in one step once the tangents are the right ones, which
those of the step before usually are. Rows that hold give way a little about their last impulse
(proximal points), so that more of them than freedoms are no matter: a robot that lies on many
points, or stands while dry friction holds its joints. Where steps turn in circles, all rows get a
compliance about an impulse that stays while Newton's steps settle, and carry nothing by it at the
fixed point: each round that settles makes them harder, each that does not makes them softer. Where
that fails, too, friction gives way.

The tangents are one system in the coordinates. With tangents p = aim - R (u' - u) of the laws at
speeds u, impulses change x = ways' p by dx with

    (1 + ways' R ways) dx = ways' (aim - p),

where R couples a row with none but those of its own contact. The links' tree leaves most of the
matrix zero, and elimination from the leaves to the root keeps it so. Where few rows hold or let go
from one iteration to the next, the factors are changed by a row at a time.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import OutRow, Row, inner
from wbc.mechanics.linear import (
    add_times,
    copy_to,
    dot,
    factor,
    factor_inertia,
    solve_factored,
    solve_inertia,
    update_inertia,
)
from wbc.mechanics.memory import row_copy, row_of
from wbc.mechanics.rows import Room, RowSystem, copied, room_for, tangents_at

NEWTON, PROXIMAL, RANGES, PASSIVE, UNSOLVED, SEVERAL = range(6)
"""What found a solution, that only a passive end was found, nothing, or several; for RANGES and
SEVERAL see `wbc.sim.step.self_locking`."""

WAYS = ("newton", "proximal", "ranges", "passive")
"""The same as words."""

# Solo12 in stance needs up to 6, TALOS 8, a robot on 20 feet that rock 13. Of 2,420 dense steps
# (corpora of tests/sim/step/test_cones.py) 2,172 settle within 20 and 2,223 within 30, with `HOLD`
# at 1e-4.
_STEPS = 20

HOLD = 3e-5
"""Compliance of rows that hold, as a share of their own. TALOS that stands with dry friction at 30
joints, and that falls and comes to rest, takes 4.3 and 5.5 linear systems in a step with 1e-5, 4.5
and 6.2 with 3e-5, 5.3 and 5.8 with 1e-4, 8.9 and 6.0 with 1e-3. With 1e-5 one of the dense steps
above ends off its laws."""
_FIRM = 1e-9  # the same where laws fall: about points, steps then need not come nearer
# Of the tolerance: what counts as a solution; and what rows may be off by where nothing comes
# nearer, as a mean by what they carry: what they make of energy is rounding then
# (`StepResult.events`).
_NEAR, _MEAN = 1e3, 10.0
# Times that friction is halved, but the last time, when there is none; and of the tolerance, what
# a passive end is off the laws of that friction.
_WEAKER, _EXACT = 5, 0.03
# Compliance of rounds, as a share of that of each row alone, and how it changes. Nine of the dense
# steps above are not solved where rows get no softer than 1; all are from 30 on. Begun at 1e-6 or
# 1e-3, one takes 16.0 or 12.8 linear systems (mean).
_SOFTEST, _HARDEST, _FIRST = 100.0, 1e-9, 1e-3
_HARDER, _SOFTER, _PROXIMAL_ROUNDS = 0.3, 30.0, 60
_WORK = 1e8  # multiplications and additions, thrice as many, after which no other way is begun


@inner
def normal_row(system: RowSystem, row: int) -> int:
    """Return the row of the normal that a tangent's friction depends on; any other row itself."""
    contacts = len(system.frictions)
    tangents = len(system.free) - contacts * 2
    return row if row < tangents else tangents - contacts + (row - tangents) // 2


@inner
def stiffened(system: RowSystem, whole: bool, room: Room) -> None:
    """Write 1 + ways' R ways (n, n) to where factors go; its lower half, or the whole."""
    contacts, (size, n) = len(system.frictions), system.ways.shape
    first, ways, rise, line = size - contacts * 3, system.ways, room.rise, room.line
    total = room.lower
    total[:] = 0.0
    for j in range(n):
        total[j, j] = 1.0
    for i in range(size):
        at, own = normal_row(system, i), ways[i]
        if rise[i, 0] == rise[i, 1] == rise[i, 2] == 0.0:
            continue
        for k in range(n):
            line[k] = rise[i, 0] * ways[at, k]
        for b in range(2 if at >= first else 0):
            if rise[i, 1 + b] != 0.0:
                add_times(rise[i, 1 + b], ways[first + contacts + (at - first) * 2 + b], line)
        for j in range(n):
            share = own[j]
            if share != 0.0:
                for k in range(n if whole else j + 1):
                    total[j, k] += share * line[k]


@inner
def same_tangents(room: Room) -> bool:
    """Return whether the tangents rise as those do of which there are factors."""
    for i in range(len(room.aim)):
        for b in range(3):
            if room.known[i, b] != room.rise[i, b]:
                return False
    return True


@inner
def follows(system: RowSystem, room: Room) -> bool:
    """Bring the factors to tangents of which few rows rise otherwise; False where many do.

    For a row that is changed an update takes n^2 steps, all factors take n^3 / 6.
    """
    left, first = len(room.line) // 6, len(room.aim) - len(system.frictions) * 2
    for i in range(len(room.aim) if room.pivots[0] < 0 else 0):
        own = 0 if i < first else 1 + (i - first) % 2
        change = room.rise[i, own] - room.known[i, own]
        room.known[i, own] = room.rise[i, own]
        for b in range(3):
            if room.known[i, b] != room.rise[i, b]:
                return False
        if change != 0.0:
            copy_to(system.ways[i], room.line)
            left -= 1
            if left < 0 or not update_inertia(room.lower, change, room.line):
                return False
    return bool(room.pivots[0] < 0)


@inner
def solve_tangents(system: RowSystem, one_sided: bool, room: Room, impulse: Row) -> bool:
    """Write the change of x (n,) to where all tangents hold; False where they contradict.

    They are those in `room`, at the impulses (r,); for `one_sided` see `tangents_at`.
    """
    change = room.change
    change[:] = 0.0
    for i in range(len(impulse)):
        if room.aim[i] != impulse[i]:
            add_times(room.aim[i] - impulse[i], system.ways[i], change)
    if not same_tangents(room) and (one_sided or not follows(system, room)):
        for i in range(len(impulse)):
            copy_to(room.rise[i], room.known[i])
        if not one_sided:
            stiffened(system, False, room)
        room.pivots[0] = -1
        if one_sided or not factor_inertia(room.lower, room.lower):
            stiffened(system, True, room)
            if not factor(room.lower, room.pivots):
                room.known[:] = np.nan
                return False
    if room.pivots[0] < 0:
        solve_inertia(room.lower, change)
    else:
        solve_factored(room.lower, room.pivots, change)
    return True


@inner
def follow_tangents(system: RowSystem, room: Room, followed: OutRow) -> None:
    """Write the impulses (r,) of the tangents after the change of x."""
    contacts, turning = len(system.frictions), room.turning
    size = len(followed)
    first = size - contacts * 3
    for i in range(size):
        turning[i] = dot(room.change, system.ways[i])
    for i in range(size):
        at = normal_row(system, i)
        followed[i] = room.aim[i] - room.rise[i, 0] * turning[at]
        for b in range(2 if at >= first else 0):
            along = first + contacts + (at - first) * 2 + b
            followed[i] -= room.rise[i, 1 + b] * turning[along]


@inner
def speeds_at(system: RowSystem, impulse: Row, x: OutRow, speed: OutRow) -> None:
    """Write x = ways' impulse (n,), and the speeds (r,) of the rows."""
    x[:] = 0.0
    for i in range(len(impulse)):
        add_times(impulse[i], system.ways[i], x)
    for i in range(len(speed)):
        speed[i] = system.free[i] + system.give[i] * impulse[i] + dot(x, system.ways[i])


@inner
def look_at(system: RowSystem, hold: float, impulse: Row, room: Room) -> tuple[float, bool]:
    """Write the speeds and tangents at row impulses (r,); return what `tangents_at` does."""
    speeds_at(system, impulse, room.line, room.speed)
    return tangents_at(system, hold, impulse, room)


@inner
def residual(system: RowSystem, impulse: Row) -> float:
    """Return the largest residual at row impulses (r,)."""
    used = system.heap.used[0]
    worst, _ = look_at(system, HOLD, impulse, room_for(system))
    system.heap.used[0] = used
    return worst


@inner
def is_near(system: RowSystem, worst: float, room: Room, impulse: Row) -> bool:
    """Return whether what rows at impulses (r,) are off their laws by makes rounding of work.

    So it may be where rows that hold contradict each other. `worst` and `room` are of `look_at`.
    """
    work = pushes = 0.0
    for i in range(len(impulse)):
        work += abs(room.off[i] * impulse[i])
        pushes += abs(impulse[i])
    rounding = work <= _MEAN * system.tolerance * pushes
    return worst <= _NEAR * system.tolerance and rounding


@inner
def newton(system: RowSystem, start: Row, firm: bool, impulse: OutRow) -> int:
    """Write the row impulses (r,) at which every row is on its law, by Newton's steps.

    Args:
        system: of the rows.
        start: (r,).
        firm: whether rows that hold hardly give way, as laws that fall and rows with a compliance
            of their own need; else steps may end near the laws where they come no nearer.
        impulse: to write.

    Returns:
        the number of linear systems solved, as a negative number where it did not converge.
    """
    room, hold = room_for(system), _FIRM if firm else HOLD
    copy_to(start, impulse)
    least, one_sided = look_at(system, hold, impulse, room)
    for iteration in range(1, _STEPS + 1):
        if not solve_tangents(system, one_sided, room, impulse):
            return -iteration
        follow_tangents(system, room, impulse)
        worst, one_sided = look_at(system, hold, impulse, room)
        if worst <= system.tolerance:
            # One more step is exact where tangents stay, and far nearer where flanks bend them.
            if len(system.flanks) > 0 or same_tangents(room):
                solve_tangents(system, one_sided, room, impulse)
                follow_tangents(system, room, impulse)
            return iteration
        if not firm and worst > 0.5 * least and is_near(system, worst, room, impulse):
            return iteration
        least = min(least, worst)
    return -_STEPS


@inner
def softened(system: RowSystem, compliance: float, about: Row) -> RowSystem:
    """Return the system with a compliance in every row, a share of its own, about `about` (r,)."""
    soft = copied(system, system.tolerance)
    for i in range(len(about)):
        own = compliance * system.own[i]
        soft.give[i] += own
        soft.free[i] -= own * about[i]
        soft.slope[i] /= 1.0 + compliance
    return soft


@inner
def proximal(system: RowSystem, start: Row, most: int, impulse: OutRow) -> int:
    """Write the row impulses (r,) by proximal rounds, like `newton`.

    A split of forces that has to move far (a corner of a sole that must let go before the rest
    fits) moves by rounding errors over compliance per round: each round that Newton solves makes
    the rows harder, each that it does not makes them softer. No round begins after `most` linear
    systems.
    """
    used, compliance, heap = 0, _FIRST, system.heap
    copy_to(start, impulse)
    following = row_of(heap, len(start))
    taken = heap.used[0]
    for _ in range(_PROXIMAL_ROUNDS):
        heap.used[0] = taken
        soft = softened(system, compliance, impulse)
        count = newton(soft, impulse, True, following)
        used += abs(count)
        if residual(system, following) <= system.tolerance:
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


@inner
def solve_laws(system: RowSystem, start: Row, work: float, impulse: OutRow) -> tuple[int, int]:
    """Write the row impulses (r,) at which every row is on its law.

    Where nothing leads to the laws, contacts get half the friction, and so on, and gears that lock
    themselves pass nothing back: a passive end.

    Args:
        system: of the rows.
        start: (r,) impulses of the step before, or zeros.
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
    begin, taken = row_copy(system.heap, start), system.heap.used[0]
    for fresh in range(2 if falls else 1):  # the last step's tangents may lead astray
        if fresh:
            begin[:] = 0.0
        system.heap.used[0] = taken
        count = newton(system, begin, falls, impulse)
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
        system.heap.used[0] = taken
        count, room = proximal(system, begin, most, impulse), room_for(system)
        used += abs(count)
        worst, _ = look_at(system, HOLD, impulse, room)
        if count > 0 or is_near(system, worst, room, impulse):
            return used, PROXIMAL
    system.heap.used[0] = taken
    weaker, heap = copied(system, _EXACT * system.tolerance), system.heap
    taken = heap.used[0]
    for i in range(len(system.laws)):
        weaker.laws[i, 4] = max(system.laws[i, 4], 0.0)
    for turn in range(_WEAKER if work >= 1.0 else 0):
        if turn or not falls:
            for c in range(len(weaker.frictions)):
                weaker.frictions[c] *= 0.5 if turn < _WEAKER - 1 else 0.0
        heap.used[0] = taken
        count = proximal(weaker, begin, most, impulse)
        used += abs(count)
        if count > 0:
            return used, PASSIVE
    return used, UNSOLVED
