"""The flanks of loose gears over a part of a step.

A gear is loose where it is compliant or has play: its motor output may leave the joint. What its
flanks pass is a law of the speed between both at the end of a part (`flank_impulse`); near a speed
it is a spring in series with the gear's row. Rounds move that speed until the law is met (Newton).

One round is enough unless a flank is reached or let go within the part. Then Newton's method may
repeat the same few guesses. The law of a flank is monotone, as all others are, so rounds that use
the steepest slope on the way always come nearer. From the ninth round on such rounds alternate with
Newton's, with the steepest slope met so far. Half of it is forgotten each time, or one steep place
far off would make all that follow slow; where the rest is too little, the round goes too far and
meets the slope between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.compiled import OutDense, OutRow, Row, inner
from wbc.mechanics.linear import copy_to
from wbc.mechanics.rows import RowSystem, own_speed
from wbc.sim.step.part_rows import PartRows
from wbc.sim.step.tables import Opened
from wbc.transmission.flank_steps import flank_impulse

END, IMPULSE, SLOPE, DAMPED, HELD = range(5)
"""Columns of flanks (m, 5): relative speed at the end, motor output ahead of joint [rad/s]; what
springs and soft flanks pass there [N m s]; its change per speed, zero where there is no spring;
what of the impulse is not the springs'; 1 where a gear holds on to its joint at all."""

RELEASED, STEEPEST, TAKEN = range(3)
"""Columns of turns (m, 3): 1 where a rigid flank lets go; the steepest slope met so far; the
slope that the round takes."""

_NEWTON = 8  # rounds, of the 3 to 5 that crossings take
_LEAST = 1e-300  # what is written for a flank that misses its law by less: zero says that none does
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


class Rounds(NamedTuple):
    """Memory for rounds; of flanks each (m, 5), turns (m, 3), empty where no gear is loose.

    Attributes:
        impulse, speed: (r,) where the round ends.
        end: (m,) relative speeds of the motor outputs there.
        near: that the round takes.
        passed: where it ends.
        safe: where the last round with the steepest slopes ended.
        turns: RELEASED to TAKEN.
    """

    impulse: OutRow
    speed: OutRow
    end: OutRow
    near: OutDense
    passed: OutDense
    safe: OutDense
    turns: OutDense


@inner
def is_safe(turn: int) -> bool:
    """Return whether a round takes the steepest slopes."""
    return turn >= _NEWTON and turn % 2 == 0


@inner
def take_hold(plant: Opened, relative: Row, step: float, end: Row, flanks: OutDense) -> None:
    """Write the flanks (m, 5) of loose gears that start at relative speeds (m,) and end at `end`.

    Springs take the chord of their energy (theta 1/2), dampers the final speed (theta_c 1). A rigid
    flank that is reached stops the relative motion; what it is overrun by, at most one step, stays.
    Flanks of rigid gears stay.
    """
    gears = plant.gears
    for i in range(len(end)):
        if not gears.yields[i]:
            continue
        half, place, rate = 0.5 * gears.play[i], plant.now.deflection[i], relative[i]
        flanks[i], flanks[i, END] = 0.0, end[i]
        if gears.stiffness[i] == np.inf:
            holds = not abs(place + 0.5 * step * rate) < half
        else:
            impulse, slope, _, damped = flank_impulse(
                gears.stiffness[i], gears.damping[i], half, step, 0.5, 1.0, place, rate, end[i]
            )
            flanks[i, IMPULSE], flanks[i, SLOPE], flanks[i, DAMPED] = impulse, slope, damped
            holds = slope > 0.0 or impulse != 0.0
        flanks[i, HELD] = 1.0 if holds else 0.0


@inner
def lean_on_flanks(
    plant: Opened, rows: PartRows, turn: int, rounds: Rounds, laws: OutDense
) -> None:
    """Write the springs of a round into laws (m, 9)."""
    near, turns = rounds.near, rounds.turns
    if turn == 0:
        take_hold(plant, rows.relative, rows.step, rows.relative, near)
    for i in range(len(near)):
        if not plant.gears.yields[i]:
            continue
        own, soft = near[i], plant.gears.stiffness[i] < np.inf
        holds = own[HELD] * (1.0 - turns[i, RELEASED]) > 0.0
        slope = own[SLOPE]
        if is_safe(turn) and holds:
            slope = max(slope, turns[i, STEEPEST])
        turns[i, TAKEN] = slope
        stiff = slope if soft else np.inf
        laws[i, 7] = stiff if holds else 0.0
        laws[i, 8] = own[IMPULSE] - slope * own[END] if holds and soft else 0.0


@inner
def misses_flanks(
    plant: Opened, rows: PartRows, system: RowSystem, turn: int, rounds: Rounds
) -> float:
    """Prepare the next round; return the greatest change of speed of a flank that is not met.

    Args:
        plant: with the gears.
        rows: of the part.
        system: with the laws that the round took.
        turn: number of the round.
        rounds: to change.

    Returns:
        zero where all are met.
    """
    gears, near, passed, turns = plant.gears, rounds.near, rounds.passed, rounds.turns
    impulse, speed, missed, safely = rounds.impulse, rounds.speed, 0.0, is_safe(turn)
    for i in range(len(near)):
        if gears.yields[i]:
            own = own_speed(system.laws[i], system.slope[i], impulse[i], speed[i])
            rounds.end[i] = own - speed[i]
    take_hold(plant, rows.relative, rows.step, rounds.end, passed)
    for i in range(len(near)):
        if not gears.yields[i]:
            continue
        change, slope = passed[i, END] - near[i, END], turns[i, TAKEN]
        more = passed[i, IMPULSE] - near[i, IMPULSE]
        size = abs(passed[i, END]) + abs(near[i, END])
        good = abs(more - slope * change) <= _MET * (abs(passed[i, IMPULSE]) + slope * size)
        place = plant.now.deflection[i] + 0.5 * rows.step * rows.relative[i]
        if gears.stiffness[i] == np.inf and np.sign(place) * impulse[i] < 0.0:
            turns[i, RELEASED], good = 1.0, False
        missed = missed if good else max(missed, abs(change), _LEAST)
        turns[i, STEEPEST] *= 0.5 if safely else 1.0
        if change != 0.0:
            turns[i, STEEPEST] = max(turns[i, STEEPEST], more / change)
    for i in range(len(near)):
        copy_to(rounds.safe[i] if turn > _NEWTON and not safely else passed[i], near[i])
        if safely:
            copy_to(passed[i], rounds.safe[i])
    return missed
