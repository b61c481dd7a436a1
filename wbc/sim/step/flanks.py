"""The flanks of loose gears over a part of a step.

A gear is loose where it is compliant or has play: its motor output may leave the joint. What its
flanks pass is a law of the speed between both at the end of a part (`flank_impulse`); near a speed
it is a spring in series with the gear's row. Rounds move that speed until the law is met.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import OutDense, Row, compiled, inner
from wbc.mechanics.newton import PASSIVE, UNSOLVED, solve_system, speeds_at
from wbc.mechanics.rows import RowSystem, own_speed
from wbc.sim.step.part_rows import PartRows, Solved
from wbc.sim.step.tables import Gears, Opened
from wbc.transmission.flank_steps import flank_impulse

END, IMPULSE, SLOPE, DAMPED, HELD = range(5)
"""Columns of flanks (m, 5): relative speed at the end, motor output ahead of joint [rad/s]; what
springs and soft flanks pass there [N m s]; its change per speed, zero where there is no spring;
what of the impulse is not the springs'; 1 where a gear holds on to its joint at all."""

RELEASED, STEEPEST, TAKEN = range(3)
"""Columns of rounds (m, 3): 1 where a rigid flank lets go; the steepest slope met so far; the
slope that the round takes."""

_NEWTON = 8  # rounds, of the 3 to 5 that crossings take
_ROUNDS = 200
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


@inner
def flanks_at(
    gears: Gears, which: int, place: float, rate: float, step: float, end: float
) -> tuple[float, float, float, bool]:
    """Return what a loose gear passes at the relative speed `end`, by `flank_impulse`.

    Springs take the chord of their energy (theta 1/2), dampers the final speed (theta_c 1). A rigid
    flank that is reached stops the relative motion; what it is overrun by, at most one step, stays.

    Args:
        gears, which: all of them, and the number of this one.
        place: of the motor output ahead of the joint, at the start [rad].
        rate: its change there [rad/s].
        step: h [s].
        end: its change at the end [rad/s].

    Returns:
        the impulse [N m s], its change per speed, what of it is not the spring's, and whether the
        gear holds on to its joint at all.
    """
    half, stiffness = 0.5 * gears.play[which], gears.stiffness[which]
    if stiffness == np.inf:
        return 0.0, 0.0, 0.0, not abs(place + 0.5 * step * rate) < half
    impulse, slope, _, damped = flank_impulse(
        stiffness, gears.damping[which], half, step, 0.5, 1.0, place, rate, end
    )
    return impulse, slope, damped, slope > 0.0 or impulse != 0.0


@inner
def take_hold(plant: Opened, relative: Row, step: float, end: Row, flanks: OutDense) -> None:
    """Write the flanks (m, 5) of loose gears that start at relative speeds (m,) and end at `end`.

    Those of rigid gears stay.
    """
    for i in range(len(end)):
        if plant.gears.yields[i]:
            place = plant.now.deflection[i]
            found = flanks_at(plant.gears, i, place, relative[i], step, end[i])
            flanks[i, END] = end[i]
            flanks[i, IMPULSE], flanks[i, SLOPE], flanks[i, DAMPED] = found[0], found[1], found[2]
            flanks[i, HELD] = 1.0 if found[3] else 0.0


@inner
def lean_on_flanks(
    gears: Gears, safely: bool, near: OutDense, rounds: OutDense, laws: OutDense
) -> None:
    """Write the springs of a round into laws (m, 9): near flanks (m, 5), with `rounds` (m, 3)."""
    for i in range(len(near)):
        if not gears.yields[i]:
            continue
        own, soft = near[i], gears.stiffness[i] < np.inf
        holds = own[HELD] * (1.0 - rounds[i, RELEASED]) > 0.0
        slope = own[SLOPE]
        if safely and holds:
            slope = max(slope, rounds[i, STEEPEST])
        rounds[i, TAKEN] = slope
        stiff = slope if soft else np.inf
        laws[i, 7] = stiff if holds else 0.0
        laws[i, 8] = own[IMPULSE] - slope * own[END] if holds and soft else 0.0


@inner
def misses_flanks(
    plant: Opened, ways: Row, near: OutDense, passed: OutDense, impulse: Row, rounds: OutDense
) -> tuple[bool, float]:
    """Return whether all flanks are met, and the greatest change of speed of one that is not.

    Args:
        plant: with the gears.
        ways: (m,) by which motor outputs have moved ahead of joints in the middle.
        near: (m, 5) flanks that the round took.
        passed: (m, 5) those where it ends.
        impulse: (r,) where it ends.
        rounds: (m, 3), whose first two columns are changed.
    """
    met, missed = True, 0.0
    for i in range(len(near)):
        if not plant.gears.yields[i]:
            continue
        change, slope = passed[i, END] - near[i, END], rounds[i, TAKEN]
        more = passed[i, IMPULSE] - near[i, IMPULSE]
        size = abs(passed[i, END]) + abs(near[i, END])
        good = abs(more - slope * change) <= _MET * (abs(passed[i, IMPULSE]) + slope * size)
        place = plant.now.deflection[i] + ways[i]
        if plant.gears.stiffness[i] == np.inf and np.sign(place) * impulse[i] < 0.0:
            rounds[i, RELEASED], good = 1.0, False
        met = met and good
        missed = missed if good else max(missed, abs(change))
        if change != 0.0:
            rounds[i, STEEPEST] = max(rounds[i, STEEPEST], more / change)
    return met, missed


@compiled(inside=True)
def solve_gripped(
    plant: Opened, rows: PartRows, system: RowSystem, start: Row, tolerance: float, solved: Solved
) -> tuple[int, int, float]:
    """Solve the rows, and the flanks of loose gears by Newton's method on their law.

    One round is enough unless a flank is reached or let go within the part. Then Newton's method
    may repeat the same few guesses. The law of a flank is monotone, as all others are, so rounds
    that use the steepest slope on the way always come nearer. From the ninth round on such rounds
    alternate with Newton's, with the steepest slope met so far. Half of it is forgotten each time,
    or one steep place far off would make all that follow slow; where the rest is too little, the
    round goes too far and meets the slope between.

    Args:
        plant: with the gears, and how they start.
        rows: of the part.
        system: of the rows; springs of loose gears are put into its laws.
        start: (r,) impulses to start from.
        tolerance: largest accepted residual of a row.
        solved: whose impulses, relative speeds at the end, and share of dampers are written.

    Returns:
        the number of linear systems solved, what `solve_system` says, and the speed by which
        flanks miss their law: zero, but where the rounds end before they meet it (PASSIVE).
    """
    gears, impulse, end, laws = plant.gears, solved.impulse, solved.end, system.laws
    if not gears.loose:
        used, way = solve_system(system, start, tolerance, 1.0, impulse)
        return used, way, 0.0
    m, work, missed, step = len(gears.rows), 0, 0.0, rows.step
    near, passed, safe = np.zeros((m, 5)), np.zeros((m, 5)), np.zeros((m, 5))
    rounds, ways = np.zeros((m, 3)), 0.5 * step * rows.relative
    speed, guess = np.empty(len(start)), start.copy()
    take_hold(plant, rows.relative, step, rows.relative, near)
    for turn in range(_ROUNDS):
        safely = turn >= _NEWTON and turn % 2 == 0
        lean_on_flanks(gears, safely, near, rounds, laws)
        used, way = solve_system(system, guess, tolerance, 1.0, impulse)
        work += used
        if way == UNSOLVED:
            return work, way, 0.0
        guess[:] = impulse
        speeds_at(system.delassus, system.free, impulse, speed)
        for i in range(m):
            end[i] = 0.0
            if gears.yields[i]:
                end[i] = own_speed(laws[i], system.slope[i], impulse[i], speed[i]) - speed[i]
        take_hold(plant, rows.relative, step, end, passed)
        if safely:
            rounds[:, STEEPEST] *= 0.5
        met, missed = misses_flanks(plant, ways, near, passed, impulse, rounds)
        solved.damped[:] = passed[:, DAMPED]
        if met:
            return work, way, 0.0
        near[:] = safe if turn > _NEWTON and not safely else passed
        if safely:
            safe[:] = passed
    return work, PASSIVE, max(missed, tolerance)
