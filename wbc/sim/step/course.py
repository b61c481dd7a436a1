"""The course of one step: smooth parts up to touchdowns, and the impacts between them.

Slow is what gravity gives within a step, g h: a step changes speeds by that much anyway, so such a
landing needs no part of its own. With a restitution e, slow is also no more than g h (1 - e)/(2 e),
from which on all bounces would be over within the step. Barriers that land slowly are kept as rows,
and so are those whose gap jumps with the length of a part, for example where a contact lets go and
is no longer pulled back: they may close within the part, but not be passed.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Flags, OutRow, Row, Vector, ask, compiled, inner
from wbc.mechanics.kinematics import moved_along
from wbc.mechanics.linear import add_times, copy_to, dot
from wbc.mechanics.newton import UNSOLVED
from wbc.sim.step.contacts import gaps_of
from wbc.sim.step.impact import HIT, settle
from wbc.sim.step.part import LANDED, part_with_mesh
from wbc.sim.step.part_rows import WAY
from wbc.sim.step.tables import LENGTH, SLOW, STAGE, TIME, TOUCH, Opened

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
    for i in range(size):
        fall[i] = late / _SOON * (fall[i] - start[i])
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
    for i in range(size):
        plant.end.jumps[i] = gap_late[i] < 0.0
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
    for i in range(size):
        end.kept[i], end.jumps[i] = now.kept[i], False
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
        for i in range(size):
            end.kept[i], end.jumps[i] = end.kept[i] or end.jumps[i], False
        result = part_with_mesh(plant, step)
    return result, step, True


NO_COMMAND, PART_FAILED, IMPACT_FAILED = 1, 10, 20
"""What a step returns that failed; that of a part or an impact more by what `solve_part` says."""

_OVER = 1e-9
"""Share of a step that is none."""


@inner
def read(given: Vector, copied: OutRow) -> None:
    """Write the entries of a vector with any stride."""
    for i in range(len(given)):
        copied[i] = given[i]


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
    kind = settle(plant, left, goes_on)
    if kind == HIT:
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
    read(q, now.position)
    read(v, now.velocity)
    read(deflection, now.deflection)
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
