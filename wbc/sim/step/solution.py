"""How the rows of a part or of an impact end: every row, flank and rotor coupling on its law.

Compliant contacts are rows, too: F = K d^(3/2) (1 + 3/2 a d') for a depth d > 0 that grows at d'
[m/s], never pulling (K. Hunt and F. Crossley, *Coefficient of Restitution Interpreted as Damping in
Vibroimpact*, J. Applied Mechanics 42, 1975). Over a part the depth goes from d0 to d1, and the
impulse is

    h (U(d1) - U(d0))/(d1 - d0) (1 + 3/2 a (d1 - d0)/h),    U = 2/5 K d^(5/2),

so that what the spring takes and gives back is exact at any step, and the rest is lost. d1 is
linear in the speed at which the contact opens, and the impulse is a convex function of it. Its
tangent is a rigid row with a compliance and a target speed. Newton's iteration puts each contact's
tangent where the rows then take it; begun at the deepest place, it comes nearer from one side.

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

from math import sqrt
from typing import NamedTuple

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, inner
from wbc.mechanics.linear import add_times, copy_to, dot, rest_of_way, solve_inertia
from wbc.mechanics.memory import copied_row, copied_table, table_of, whole_of
from wbc.mechanics.newton import (
    PASSIVE,
    SEVERAL,
    UNSOLVED,
    residual,
    solve_system,
    speeds_at,
)
from wbc.mechanics.rows import RowSystem, copied, own_speed
from wbc.sim.step.part_rows import PartRows, part_system, rotor_brings
from wbc.sim.step.self_locking import solve_rows
from wbc.sim.step.tables import DISSIPATION, HERTZ, Opened
from wbc.structures import WORDS, kept, structured
from wbc.transmission.flank_steps import flank_impulse

NO_INERTIA = SEVERAL + 1
"""H_l is not positive definite."""
USED, WAY, MISSED = range(3)
"""Of a solution: linear systems solved, what found it, and the speed by which a passive one misses
the laws, else zero."""

_ROUNDS = 200
"""In 53 hostile scenes (12,768 steps) 10 leave steps of three scenes unsettled, 25 those of one,
and 50 none."""
_COUPLING_TOLERANCE = 1e-13
NEVER = -1e9
"""[m/s] lowest speed of a row that no contact holds."""
_NEAR = 1e-5  # share of a depth below which a difference quotient is the slope in the middle


END, IMPULSE, SLOPE, HELD = range(4)
"""Columns of flanks (m, 4): relative speed at the end, motor output ahead of joint [rad/s]; what
springs and soft flanks pass there [N m s]; its change per speed, zero where there is no spring; 1
where a gear holds on to its joint at all."""

RELEASED, STEEPEST, TAKEN = range(3)
"""Columns of turns: 1 where a rigid flank lets go; the steepest slope met so far; the
slope that the round takes."""

_NEWTON = 8  # rounds, of the 3 to 5 that crossings take
_LEAST = 1e-300  # what is written for a flank that misses its law by less: zero says that none does
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


@structured
class Rounds(NamedTuple):
    """Memory for rounds: flanks and turns, each (m, 4), empty where no gear is loose.

    Attributes:
        near: that the round takes.
        passed: where it ends.
        safe: where the last round with the steepest slopes ended.
        turns: RELEASED to TAKEN.
    """

    near: OutDense
    passed: OutDense
    safe: OutDense
    turns: OutDense


@inner
def rounds_of(plant: Opened, count: int) -> Rounds:
    """Return memory for rounds of gears, zeros."""
    room = table_of(plant.heap, 4 * count, 4)
    room[:], near, passed = 0.0, room[:count], room[count : 2 * count]
    rounds = Rounds(near, passed, room[2 * count : 3 * count], room[3 * count :])
    found: Rounds = kept(whole_of(plant.heap, WORDS), rounds)
    return found


@inner
def is_safe(turn: int) -> bool:
    """Return whether a round takes the steepest slopes."""
    return turn >= _NEWTON and turn % 2 == 0


@inner
def take_hold(plant: Opened, rows: PartRows, end: Row, flanks: OutDense) -> None:
    """Write the flanks (m, 4) of loose gears of a part that ends at relative speeds (m,).

    Springs take the chord of their energy (theta 1/2), dampers the final speed (theta_c 1). A rigid
    flank that is reached stops the relative motion; what it is overrun by, at most one step, stays.
    Flanks of rigid gears stay.
    """
    gears, step = plant.gears, rows.step
    for i in range(len(end)):
        if not gears.yields[i]:
            continue
        half, place, rate = 0.5 * gears.play[i], plant.now.deflection[i], rows.relative[i]
        flanks[i], flanks[i, END] = 0.0, end[i]
        if gears.stiffness[i] == np.inf:
            holds = not abs(place + 0.5 * step * rate) < half
        else:
            impulse, slope, _, damped = flank_impulse(
                gears.stiffness[i], gears.damping[i], half, step, 0.5, 1.0, place, rate, end[i]
            )
            flanks[i, IMPULSE], flanks[i, SLOPE], rows.damped[i] = impulse, slope, damped
            holds = slope > 0.0 or impulse != 0.0
        flanks[i, HELD] = 1.0 if holds else 0.0


@inner
def lean_on_flanks(
    plant: Opened, rows: PartRows, turn: int, rounds: Rounds, laws: OutDense
) -> None:
    """Write the springs of a round into laws (m, 9)."""
    near, turns = rounds.near, rounds.turns
    if turn == 0:
        take_hold(plant, rows, rows.relative, near)
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
    impulse, speed, missed, safely = rows.impulse, rows.speed, 0.0, is_safe(turn)
    for i in range(len(near)):
        if gears.yields[i]:
            own = own_speed(system.laws[i], system.slope[i], impulse[i], speed[i])
            rows.end[i] = own - speed[i]
    take_hold(plant, rows, rows.end, passed)
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


@inner
def stored_at(stiffness: float, depth: float) -> float:
    """Return what a contact stores at a depth [m]: U, none outside."""
    return 0.4 * stiffness * depth * depth * sqrt(depth) if depth > 0.0 else 0.0


@inner
def mean_force(plant: Opened, before: float, after: float, step: float) -> tuple[float, float]:
    """Return the mean force [N] between two depths [m], and its derivative by the second."""
    stiffness, way = plant.bounds[HERTZ], after - before
    if abs(way) <= _NEAR * max(abs(before), abs(after)):
        root = sqrt(max(0.5 * (before + after), 0.0))
        force, slope = stiffness * root**3, 0.75 * stiffness * root
    else:
        force = (stored_at(stiffness, after) - stored_at(stiffness, before)) / way
        slope = (stiffness * sqrt(max(after, 0.0)) ** 3 - force) / way
    rate = 1.5 * plant.bounds[DISSIPATION] / step
    share = 1.0 + rate * way
    if share <= 0.0 or force <= 0.0:
        return 0.0, 0.0
    return share * force, share * slope + rate * force


@inner
def softened(plant: Opened, rows: PartRows, system: RowSystem) -> RowSystem:
    """Return the system with compliant contacts as their tangents at the speeds of the rows."""
    softer, count, step = copied(system, system.tolerance), len(system.targets), rows.step
    speed = rows.speed
    for c in range(len(rows.depths)):
        at = count - len(rows.depths) + c
        row = len(system.laws) + at
        after = rows.depths[c, 1] - 0.5 * step * speed[row]
        force, rise = mean_force(plant, rows.depths[c, 0], after, step)
        stiff, push = 0.5 * step * step * rise, step * force
        own = system.own[row]
        give = 1.0 / stiff if stiff > 1e-12 / own else 0.0
        softer.give[row] = give
        softer.slope[row] = 1.0 / (own + give)
        softer.targets[at] = speed[row] + push * give if give > 0.0 else NEVER
    return softer


@inner
def misses_contacts(plant: Opened, rows: PartRows, system: RowSystem) -> float:
    """Return by how much compliant contacts miss their law at most, as a speed."""
    off = 0.0
    for c in range(len(rows.depths)):
        row = len(system.laws) + len(system.targets) - len(rows.depths) + c
        after = rows.depths[c, 1] - 0.5 * rows.step * rows.speed[row]
        force, _ = mean_force(plant, rows.depths[c, 0], after, rows.step)
        off = max(off, abs(rows.step * force - rows.impulse[row]) * system.own[row])
    return off


@inner
def lag_coupling(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    speed: Row,
    last: Row,
    laws: Dense,
    shifted: OutRow,
) -> None:
    """Put the inertial coupling of rotors and housings at a last iterate into the rows.

    The rotor's momentum is I_r (phi_dot + a'J_omega v), so a change of v asks the impulse N C dv of
    the rotor (at the motor output, C = I_r a'J_omega) and a change of its spin asks C' N dw of the
    links. Both are taken from the last iterate; the iteration contracts by about the share of rotor
    in link inertia.

    Args:
        plant: with `coupling` and `gyration`.
        rows: of the part.
        system: of the rows, whose free speeds are changed.
        speed: v (nv,) before.
        last: v (nv,) of the last iterate.
        laws: (m, 9) without coupling, over a step; those of the system are changed.
        shifted: v (nv,) without the rows, to write.
    """
    gears, n, m, step = plant.gears, len(speed), len(plant.gears.rows), rows.step
    for c in range(n):
        shifted[c] = -step * gears.gyration[0, c]
    for i in range(m):
        turned, taken = 0.0, step * gears.gyration[0, n + i]
        for c in range(n):
            turned += gears.rows[i, c] * (last[c] - speed[c])
            taken += gears.coupling[i, c] * (last[c] - speed[c])
        add_times(-turned, gears.coupling[i], shifted)
        if step > 0.0:
            system.laws[i, 0], system.laws[i, 1] = laws[i, 0] - taken, laws[i, 1] - taken
        elif not gears.yields[i]:
            brought = gears.inertia[i] * rows.motor[i] - taken
            rotor_brings(gears, i, brought, system.laws[i])
    solve_inertia(rows.lower, shifted)
    add_times(1.0, rows.free, shifted)
    for i in range(len(system.free)):
        system.free[i] = dot(shifted, rows.matrix[i])


@inner
def settles(after: Row, last: OutRow) -> float:
    """Return by how much a round has changed v (nv,), zero where it is rounding."""
    moved, largest = 0.0, 0.0
    for c in range(len(after)):
        moved = max(moved, abs(after[c] - last[c]))
        largest = max(largest, abs(last[c]))
    return 0.0 if moved <= _COUPLING_TOLERANCE * (1.0 + largest) else moved


@inner
def solve_part(plant: Opened, rows: PartRows, speed: Row, work: float) -> int:
    """Write how the rows of a part end, with every row, flank and coupling on its law.

    Rounds take flanks and compliant contacts as tangents, and coupling as it was in the last one,
    until none of them changes.

    Args:
        plant: what moves; `after` and `work` of its end are written.
        rows: of the part; laws and free velocity are those of the solution afterwards.
        speed: v (nv,) before.
        work: share of what `solve_system` may do in an impact.

    Returns:
        what found it; UNSOLVED or more where nothing did.
    """
    gears, heap = plant.gears, plant.heap
    system, coupled = part_system(plant, rows), len(gears.coupling) > 0
    loose, soft = gears.loose and rows.step > 0.0, len(rows.depths) > 0
    laws, last, shifted = system.laws, copied_row(heap, speed), rows.free
    tolerance, taken, used, way, missed = system.tolerance, system, 0, 0, 0.0
    impulse, after, work_of = rows.impulse, plant.end.after, plant.end.work
    rounds = rounds_of(plant, len(gears.rows) if loose else 0)
    if coupled:
        laws, shifted = copied_table(heap, laws), copied_row(heap, rows.free)
    if soft:
        copy_to(system.free, rows.speed)
    begun = heap.used[0]
    for turn in range(_ROUNDS):
        heap.used[0] = begun
        if coupled:
            lag_coupling(plant, rows, system, speed, last, laws, shifted)
        if loose:
            lean_on_flanks(plant, rows, turn, rounds, system.laws)
        if soft:
            taken = softened(plant, rows, system)
        if coupled or gears.loose:
            more, way = solve_system(taken, rows.start, work, impulse)
        else:
            more, way = solve_rows(taken, rows.start, work, impulse)
        used, missed = used + more, 0.0
        speeds_at(system, impulse, after, rows.speed)
        rest_of_way(rows.lower, after)
        add_times(1.0, shifted, after)
        if way >= UNSOLVED or not (coupled or soft or loose):
            break
        copy_to(impulse, rows.start)
        if loose:
            missed = misses_flanks(plant, rows, system, turn, rounds)
        if soft:
            off = misses_contacts(plant, rows, system)
            missed = max(missed, off if off > tolerance else 0.0)
        if coupled:
            missed = max(missed, settles(after, last))
            copy_to(after, last)
        if missed == 0.0:
            break
    if way < UNSOLVED and not np.isfinite(np.sum(after)):
        way = UNSOLVED
    if missed > 0.0 and way < UNSOLVED:  # the rounds end before all is settled
        way, missed = PASSIVE, max(missed, tolerance)
    if way == PASSIVE:
        missed = max(missed, residual(system, impulse))
    copy_to(shifted, rows.free)
    work_of[USED], work_of[WAY], work_of[MISSED] = used, way, missed
    return way
