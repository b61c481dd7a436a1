"""The course of one step: smooth parts up to touchdowns, and the impacts between them.

Slow is what gravity gives within a step, g h: a step changes speeds by that much anyway, so such a
landing needs no part of its own. With a restitution e, slow is also no more than g h (1 - e)/(2 e),
from which on all bounces would be over within the step. Barriers that land slowly are kept as rows,
and so are those whose gap jumps with the length of a part, for example where a contact lets go and
is no longer pulled back: they may close within the part, but not be passed.

In an impact barriers that are reached stop the robot at once, and give back what they do. Newton's
restitution with friction may ask for more energy than there was (Kane's paradox), or for what the
joints cannot do. Without restitution an impact only loses energy; towards the share of the
restitution that just does so, a fixed number of tries.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Flags, OutRow, Row, Vector, ask, compiled, inner
from wbc.mechanics.kinematics import moved_along
from wbc.mechanics.linear import add_times, copy_to, dot
from wbc.mechanics.memory import row_copy
from wbc.mechanics.newton import UNSOLVED
from wbc.sim.step.books import kinetic_of, mesh_loss
from wbc.sim.step.contacts import gaps_of, weigh
from wbc.sim.step.part import LANDED, part_with_mesh
from wbc.sim.step.part_rows import NO_INERTIA, WAY, PartRows, impact_rows, motor_speeds, solve_part
from wbc.sim.step.tables import BOOK, LENGTH, RESTITUTION, SLOW, STAGE, TIME, TOUCH, Opened

_TRIES = 40
_SOON = 1e-6  # [s] over which gaps tell their speeds


@inner
def is_ahead(plant: Opened, i: int) -> bool:
    """Return whether a part may land on a barrier: it is rigid, and neither closed nor kept."""
    return not plant.now.closed[i] and not plant.end.kept[i] and i < plant.obstacles.rigid


@inner
def nearest(plant: Opened, start: Row, gap: Row, out: OutRow) -> float:
    """Write gaps (2 j + c,) of the barriers ahead, infinite for others; return the least.

    An overlap at the start is on its way out; what is written counts from there.
    """
    least = np.inf
    for i in range(len(gap)):
        out[i] = gap[i] - min(start[i], 0.0) if is_ahead(plant, i) else np.inf
        least = min(least, out[i])
    return least


@inner
def first_crossing(early: Row, late: Row, fall: Row, bent: bool) -> float:
    """Return the share of the way at which the first gap closes.

    Args:
        early, late: (2 j + c,) gaps at both ends of the way.
        fall: (2 j + c,) by which they would change on it at the speeds of its start.
        bent: whether they are parabolas that start like that, else straight lines.
    """
    first = 1.0
    for i in range(len(late)):
        if late[i] < 0.0:
            gap = max(early[i], 0.0)
            along = fall[i] if bent else late[i] - gap
            bend = late[i] - gap - along
            root = sqrt(max(along * along - 4.0 * bend * gap, 0.0))
            if along > 0.0:
                first = min(first, 0.5 * (along + root) / -bend)
            else:
                first = min(first, 2.0 * gap / max(root - along, 1e-300))
    return min(max(first, 1e-4), 1.0 - 1e-4)


@compiled(inside=True)
def to_landing(plant: Opened, start: Row, whole: tuple[int, float]) -> tuple[int, float]:
    """Do the part that ends where the first barrier is reached (regula falsi).

    Gaps are parabolas of the length of a part but for what is of third order, and the speeds at the
    start are known: the first try is enough, unless a gap jumps. There is no place of landing then.
    The flow ends before the jump, and has no length where that is at once.

    Args:
        plant: where the whole part has ended; barriers whose gaps jump are written to `jumps`.
        start: (2 j + c,) gaps.
        whole: what the whole part returned, and its length [s].

    Returns:
        the same of the part that ends there.
    """
    (result, late), early, size = whole, 0.0, len(start)
    q, v = plant.now.position, plant.now.velocity
    ahead, gap_early, gap_late = np.empty(size), np.empty(size), np.empty(size)
    nearest(plant, start, start, gap_early)
    plant.end.jumps[:] = False
    if not nearest(plant, start, plant.end.gap, gap_late) < 0.0:
        return whole  # What overlaps now did so at the start and is moving out.
    near, fall = np.empty(len(q)), np.empty(size)
    moved_along(plant.tree.joints, q, v, _SOON, near)
    gaps_of(plant, near, fall)
    fall = late / _SOON * (fall - start)
    for turn in range(_TRIES):
        # Every third try halves, lest one end of the interval never move.
        share = 0.5 if turn % 3 == 2 else first_crossing(gap_early, gap_late, fall, turn == 0)
        trial = early + share * (late - early)
        result = part_with_mesh(plant, trial)
        least = nearest(plant, start, plant.end.gap, ahead)
        if result >= 10 or abs(least) <= 0.5 * TOUCH:
            return result, trial
        if least > 0.0:
            early = trial
            copy_to(ahead, gap_early)
        else:
            late = trial
            copy_to(ahead, gap_late)
    if early > 0.0:
        result = part_with_mesh(plant, early)
    plant.end.jumps[:] = gap_late < 0.0
    return result, early


@compiled(inside=True)
def flow_until(plant: Opened, step: float) -> tuple[int, float, bool]:
    """Do the part to the end of a step, or to the next touchdown.

    Points that all land slowly are kept instead.

    Args:
        plant: what moves, with its state; `kept` and `jumps` of its end are written, too.
        step: that is left [s].

    Returns:
        what `part_of_step` does, the length of the part [s], and whether more barriers are kept.
    """
    now, end, length, short = plant.now, plant.end, step, plant.bounds[SLOW] * step * step
    size, limits = len(now.closed), plant.obstacles.limits
    end.kept[:], end.jumps[:] = now.kept, False
    result = part_with_mesh(plant, step)
    if result != LANDED:
        return result, step, False
    start = np.empty(size)
    gaps_of(plant, now.position, start)
    while result == LANDED:
        slowly = True
        for i in range(size):
            end.jumps[i] = is_ahead(plant, i) and end.gap[i] < -TOUCH
            if end.jumps[i]:
                slowly = slowly and i >= limits and start[i] - end.gap[i] <= short
        if not slowly:
            result, length = to_landing(plant, start, (result, step))
            if length > 0.0:
                return result, length, True
        end.kept[:] |= end.jumps
        end.jumps[:] = False
        result = part_with_mesh(plant, step)
    return result, step, True


_SLOW = 1e-9
_ROUNDING = 1e-9
# Shares of the restitution tried between none and all; the loss is quadratic in the share while
# rows keep to their pieces, so that false position meets it soon.
_SHARES = 5
# Of what a step may do, for an impact with restitution: there is another without.
_SHARE_OF_WORK = 0.1


@inner
def reaches(plant: Opened, goes_on: bool) -> bool:
    """Write the barriers that are reached, and those that take part; return whether there are any.

    Arguments as of `impact_at`. The poses and touches then stand where the robot is.
    """
    end, before, found = plant.end, plant.now.closed, False
    gaps_of(plant, plant.now.position, end.gap)
    for i in range(len(before)):
        near = end.gap[i] <= TOUCH and i < plant.obstacles.rigid
        end.fresh[i] = near and not before[i]
        end.closed[i] = before[i] or end.fresh[i] or (goes_on and plant.now.kept[i])
        found = found or (end.closed[i] and not before[i])
    return found


@inner
def impact_targets(plant: Opened, share: float, left: float, rows: PartRows) -> bool:
    """Write at which speeds the barriers are to part; return whether one of them is coming.

    What is kept, or was reached in the step before, does not spring back. Arguments as of
    `impact_at`; found[BOOK.share] is that share where any springs back.
    """
    end, now, v, coming = plant.end, plant.now, plant.now.velocity, False
    before = now.closed
    for row in range(len(rows.held)):
        i = rows.held[row]
        approach = dot(v, rows.matrix[len(rows.laws) + row])
        ahead = not before[i] and not end.fresh[i]
        least = -2.0 * end.gap[i] / left if ahead else 0.0
        back = 0.0 if ahead or now.struck[i] or now.kept[i] else plant.bounds[RESTITUTION]
        opening = -share * back * min(approach, 0.0)
        if back * min(approach, 0.0) < 0.0:
            end.books[BOOK.share] = share
        coming = coming or (not before[i] and approach < least - _SLOW)
        rows.targets[row] = least + opening
    return coming


@inner
def impact_at(plant: Opened, share: float, left: float, goes_on: bool) -> bool:
    """Write the impact on barriers that have just been reached into `plant.end`, see `settle`.

    Args:
        plant: what moves, with its state.
        share: of the restitution.
        left, goes_on: see `settle`.

    Returns:
        whether there is one: something is reached, and with speed. It failed where work[WAY] is
        UNSOLVED or more; found[BOOK.share] is zero where nothing springs back.
    """
    end, gravity, before, v = plant.end, plant.tree.gravity, plant.now.closed, plant.now.velocity
    gears, found = plant.gears, end.books
    found[:] = 0.0
    if not reaches(plant, goes_on):
        return False
    weigh(plant)
    rows = impact_rows(plant)
    if not rows.lower[0, 0] > 0.0:
        end.work[WAY] = NO_INERTIA
        return True
    if not impact_targets(plant, share, left, rows):
        for i in range(len(before)):
            end.closed[i] = before[i] or end.fresh[i]
        return False
    found[BOOK.kinetic] = kinetic_of(plant, v, rows.motor)
    work = 1.0 if found[BOOK.share] == 0.0 else _SHARE_OF_WORK
    way = solve_part(plant, rows, v, work)
    copy_to(rows.impulse[: len(gears.rows)], end.mesh_impulse)
    if way >= UNSOLVED:
        return True
    following = row_copy(plant.heap, rows.motor)
    motor_speeds(gears, end.after, rows.motor, following)
    found[BOOK.impact_mesh] = mesh_loss(gears, v, end.after, rows.motor, following, rows.impulse)
    found[BOOK.impact] = (
        found[BOOK.kinetic] - kinetic_of(plant, end.after, following) - found[BOOK.impact_mesh]
    )
    # What parts so slowly that gravity brings it back within the step stays closed.
    slow = 0.5 * left * np.sqrt(dot(gravity, gravity))
    for row in range(len(rows.held)):
        i, speed = rows.held[row], rows.speed[len(rows.laws) + row]
        parts = speed > max(TOUCH, slow)
        end.closed[i] = (before[i] or end.fresh[i]) and not parts
    return True


@inner
def lost_by(plant: Opened) -> float:
    """Return what an impact loses in its contacts [J]; no number where it has no solution."""
    return float(plant.end.books[BOOK.impact] if plant.end.work[WAY] < UNSOLVED else np.nan)


@inner
def settle(plant: Opened, left: float, goes_on: bool) -> bool:
    """Take the impact on barriers that have just been reached, into `plant.end`.

    A barrier counts as reached where its gap is closed and the state does not know it to be. After
    the impact those stay closed that part so slowly that gravity would bring them back within what
    is left of the step: their rows let them open, and spare them an impact and a part of their own.

    A kept barrier is a row of the rest of the step, and the row acts from the middle on. An impact
    elsewhere must not drive the robot through it before: where it closes faster than 2 gap/left it
    takes part in the impact, and then closes at that speed.

    The impact has the largest share of the restitution at which it makes no energy, by a few tries.

    Args:
        plant: what moves, with its state.
        left: of the step [s].
        goes_on: whether there is a rest of the step, of which the kept barriers are rows.

    Returns:
        whether there is one, see `impact_at`.
    """
    found, high, low = plant.end.books, 1.0, 0.0
    if plant.forces.asked != 0:
        ask(plant.forces.asked)
    hit = impact_at(plant, 1.0, left, goes_on)
    lost_high = lost_by(plant)
    if not hit or found[BOOK.share] == 0.0 or lost_high >= -_ROUNDING * found[BOOK.kinetic]:
        return hit
    impact_at(plant, 0.0, left, goes_on)
    lost_low = lost_by(plant)
    for _ in range(_SHARES if lost_low == lost_low else 0):
        share = 0.5 * (low + high)
        if lost_high < 0.0:
            share = low + (high - low) * lost_low / (lost_low - lost_high)
            share = min(max(share, low + 0.1 * (high - low)), high - 0.1 * (high - low))
        impact_at(plant, share, left, goes_on)
        lost = lost_by(plant)
        if lost >= -_ROUNDING * found[BOOK.kinetic]:
            low, lost_low = share, lost
        else:
            high, lost_high = share, lost
    impact_at(plant, low, left, goes_on)
    return True


NO_COMMAND, PART_FAILED, IMPACT_FAILED = 1, 10, 20
"""What a step returns that failed; that of a part or an impact more by what `solve_part` says."""

# Share of a step that is none.
_OVER = 1e-9


@inner
def note(plant: Opened, ended: bool) -> None:
    """Write down a part or an impact that has ended, else the end of the step."""
    now, numbers, flow = plant.now.words, plant.now.numbers, plant.now.flow
    place = int(numbers[STAGE])
    if place == len(plant.stages):
        ask(plant.forces.full)
    copy_to(now, plant.stages[place])
    if ended:
        copy_to(plant.end.words, plant.stages[place, len(now) :])
        add_times(1.0, plant.end.books[: len(flow)], flow)
        numbers[STAGE] += 1.0


@compiled(inside=True)
def meet(plant: Opened, left: float, goes_on: bool) -> int:
    """Take the impact on what has just been reached, see `settle`; return how it failed, or zero.

    Barriers that are reached for the second time in a step are kept.
    """
    now, end = plant.now, plant.end
    now.numbers[LENGTH] = 0.0
    if settle(plant, left, goes_on):
        if end.work[WAY] >= UNSOLVED:
            return IMPACT_FAILED + int(end.work[WAY])
        note(plant, True)
        copy_to(end.after, now.velocity)
    for i in range(len(now.closed)):
        now.closed[i] = end.closed[i]
        now.kept[i] = now.kept[i] or (now.struck[i] and end.fresh[i])
        # What rests in touch at the start was not reached within the step.
        now.struck[i] = now.struck[i] or (end.fresh[i] and now.numbers[STAGE] > 0.0)
    return 0


@compiled(inside=True)
def go_on(plant: Opened, known: bool) -> int:
    """Do the parts and impacts of a step; return as `take_step` does.

    Barriers that are kept are rows of what is left of the step: they may close within it, but not
    be passed. A kept row closes at some speed, which an impact is to take: at the end of the step
    for all, and before it for those that close faster than what is left of it can stop.

    Args:
        plant: with the state at the start.
        known: whether that tells which barriers hold.
    """
    now, end, over, failed = plant.now, plant.end, False, 0
    numbers = now.numbers
    left = step = numbers[LENGTH]
    if not known:
        failed = meet(plant, step, False)
    while failed == 0 and not over:
        result, length, more = flow_until(plant, left)
        if result >= PART_FAILED:
            return result
        numbers[LENGTH] = length
        note(plant, True)
        left, numbers[TIME] = left - length, numbers[TIME] + length
        copy_to(end.position, now.position)
        copy_to(end.velocity, now.velocity)
        copy_to(end.impulse, now.impulse)
        copy_to(end.deflection, now.deflection)
        copy_to(end.motor_speed, now.motor_speed)
        keeps, over = False, left <= _OVER * step
        for i in range(len(now.closed)):
            if more:
                now.kept[i] = end.kept[i] or end.jumps[i]
            now.closed[i] = end.closed[i] and not now.kept[i]
            keeps = keeps or now.kept[i]
        if keeps or not over:
            failed = meet(plant, step if over else left, keeps and not over)
    note(plant, False)
    return failed


@compiled
def take_step(
    plant: Opened,
    q: Vector,
    v: Vector,
    impulse: Row,
    deflection: Vector,
    speed: Vector,
    closed: Flags,
    torque: Vector,
) -> int:
    """Take a step: smooth parts, and the impacts between them.

    Args:
        plant: what moves, with outer forces; `now.numbers` has TIME and, as LENGTH, h [s].
        q, v, impulse, deflection, speed, closed: of the `SimState` at the start.
        torque: (m,) [N m] commanded on the rotors, which give it within their bounds. Where loops
            ask for what acts in the middle of parts, it is written anew there.

    Returns:
        zero, or how it failed, see NO_COMMAND; `plant.stages` holds the course of the step.
    """
    now, forces, good = plant.now, plant.forces, True
    known = len(closed) == len(now.closed)
    now.deflection[:], now.flow[:] = 0.0, 0.0
    now.numbers[STAGE] = 0.0
    now.position[:], now.velocity[:] = q, v
    now.deflection[: len(deflection)] = deflection
    if len(impulse) == len(now.impulse):
        copy_to(impulse, now.impulse)
    else:
        now.impulse[:] = 0.0
    for i in range(len(torque)):
        now.motor_speed[i] = speed[i] if len(speed) else dot(now.velocity, plant.gears.rows[i])
        good = good and bool(np.isfinite(torque[i]))
        now.command[i] = min(max(torque[i], forces.low[i]), forces.high[i])
    copy_to(now.command, forces.command)
    now.closed[:], now.kept[:], now.struck[:] = False, False, False
    for i in range(len(closed) if known else 0):
        now.closed[i] = closed[i]
    return go_on(plant, known) if good else NO_COMMAND
