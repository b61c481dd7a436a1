"""The course of one step: smooth parts, and the impacts between them."""

from __future__ import annotations

from wbc.compiled import Flags, Row, ask, compiled, inner
from wbc.mechanics.linear import copy_to, dot
from wbc.mechanics.newton import UNSOLVED
from wbc.sim.step.impact import HIT, WAY, settle
from wbc.sim.step.landing import flow_until
from wbc.sim.step.tables import DEFLECTION, LENGTH, NOTED, SPEED, STAGE, TIME, Opened

PART_FAILED, IMPACT_FAILED = 10, 20
"""What a step returns that failed, and as much more as `Solved.way` says."""

_OVER = 1e-9
"""Share of a step that is none."""


@inner
def begin_step(
    plant: Opened, q: Row, v: Row, impulse: Row, deflection: Row, speed: Row, closed: Flags
) -> bool:
    """Write the state in which a step starts, see `SimState`; return if it says what is closed."""
    now, known = plant.now, len(closed) == len(plant.now.closed)
    now.impulse[:], now.deflection[:], now.numbers[:] = 0.0, 0.0, 0.0
    copy_to(q, now.position)
    copy_to(v, now.velocity)
    copy_to(deflection, now.deflection)
    if len(impulse) == len(now.impulse):
        copy_to(impulse, now.impulse)
    for i in range(len(now.motor_speed)):
        now.motor_speed[i] = speed[i] if len(speed) else dot(v, plant.gears.rows[i])
    for i in range(len(now.closed)):
        now.closed[i] = known and closed[i]
        now.kept[i], now.slow[i], now.struck[i] = False, False, False
    return known


@inner
def end_part(plant: Opened, more: bool) -> bool:
    """Go on to the end of a part; return whether barriers are kept.

    Args:
        plant: what moves.
        more: whether more barriers are kept from now on, see `flow_until`.
    """
    now, end, keeps = plant.now, plant.end, False
    copy_to(end.position, now.position)
    copy_to(end.velocity, now.velocity)
    copy_to(end.impulse, now.impulse)
    copy_to(end.deflection, now.deflection)
    copy_to(end.motor_speed, now.motor_speed)
    for i in range(len(now.closed)):
        if more:
            now.slow[i] = now.slow[i] or end.slow[i]
            now.kept[i] = end.kept[i] or end.jumps[i]
        now.closed[i] = end.closed[i] and not now.kept[i]
        keeps = keeps or now.kept[i]
    return keeps


@inner
def move_motors(plant: Opened) -> None:
    """Give loose gears the motion of their motor outputs."""
    now, motion = plant.now, plant.gears.motion
    for i in range(len(motion)):
        motion[i, DEFLECTION], motion[i, SPEED] = now.deflection[i], now.motor_speed[i]


@inner
def note(plant: Opened, words: Row) -> None:
    """Write down one more stage, a part or an impact with its words; Python takes those before."""
    now, numbers, count = plant.now.words, plant.now.numbers, int(plant.now.numbers[NOTED])
    if count == len(plant.stages):
        ask(plant.forces.full)
        count = 0
    copy_to(now, plant.stages[count])
    copy_to(words, plant.stages[count, len(now) :])
    numbers[NOTED], numbers[STAGE] = count + 1.0, numbers[STAGE] + 1.0


@compiled(inside=True)
def meet(plant: Opened, left: float, goes_on: bool) -> int:
    """Take the impact on what has just been reached, see `settle`; return how it failed, or zero.

    Barriers that are reached for the second time in a step are kept.
    """
    now, hit = plant.now, plant.hit
    now.numbers[LENGTH] = 0.0
    kind = settle(plant, left, goes_on)
    if kind == HIT:
        if hit.found[WAY] >= UNSOLVED:
            return IMPACT_FAILED + int(hit.found[WAY])
        note(plant, hit.words)
        copy_to(hit.after, now.velocity)
    for i in range(len(now.closed)):
        now.closed[i] = hit.closed[i]
        now.kept[i] = now.kept[i] or (now.struck[i] and hit.fresh[i])
        # What rests in touch at the start was not reached within the step.
        now.struck[i] = now.struck[i] or (hit.fresh[i] and now.numbers[STAGE] > 0.0)
    return 0


@compiled
def take_step(
    plant: Opened,
    q: Row,
    v: Row,
    impulse: Row,
    deflection: Row,
    speed: Row,
    closed: Flags,
    time: float,
    step: float,
) -> int:
    """Take a step: smooth parts, and the impacts between them.

    Barriers that are kept are rows of what is left of the step: they may close within it, but not
    be passed. A kept row closes at some speed, which an impact is to take: at the end of the step
    for all, and before it for those that close faster than what is left of it can stop.

    Args:
        plant: what moves, with the forces.
        q, v, impulse, deflection, speed, closed, time: of the `SimState` at the start.
        step: h [s].

    Returns:
        zero, or how it failed, see IMPACT_FAILED; the end of the step is in `plant.now`.
    """
    numbers, left, over, failed = plant.now.numbers, step, False, 0
    known, numbers[TIME] = begin_step(plant, q, v, impulse, deflection, speed, closed), time
    move_motors(plant)
    if not known:
        failed = meet(plant, step, False)
    while failed == 0 and not over:
        result, length, more = flow_until(plant, left)
        if result >= PART_FAILED:
            return result
        numbers[LENGTH] = length
        note(plant, plant.end.words)
        left, numbers[TIME] = left - length, numbers[TIME] + length
        keeps, over = end_part(plant, more), left <= _OVER * step
        move_motors(plant)
        if keeps or not over:
            failed = meet(plant, step if over else left, keeps and not over)
    return failed
