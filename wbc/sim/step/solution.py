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
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Dense, OutRow, Row, compiled, inner
from wbc.mechanics.linear import add_times, copy_to, dot, solve_inertia
from wbc.mechanics.newton import (
    PASSIVE,
    SEVERAL,
    UNSOLVED,
    residuals,
    solve_system,
    speeds_at,
    tolerance_of,
    velocity_after,
)
from wbc.mechanics.rows import RowSystem, copied
from wbc.sim.step.flanks import DAMPED, Rounds, lean_on_flanks, misses_flanks
from wbc.sim.step.gears import rotor_brings
from wbc.sim.step.part_rows import PartRows, Solved, part_system
from wbc.sim.step.self_locking import solve_rows
from wbc.sim.step.tables import DISSIPATION, HERTZ, Opened

NO_INERTIA = SEVERAL + 1
"""H_l is not positive definite."""

_ROUNDS = 200
"""In 53 hostile scenes (12,768 steps) 10 leave steps of three scenes unsettled, 25 those of one,
and 50 none."""
_COUPLING_TOLERANCE = 1e-13
NEVER = -1e9
"""[m/s] lowest speed of a row that no contact holds."""
_NEAR = 1e-5  # share of a depth below which a difference quotient is the slope in the middle


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
def softened(plant: Opened, rows: PartRows, system: RowSystem, speed: Row) -> RowSystem:
    """Return the system with compliant contacts as their tangents at row speeds (r,)."""
    softer, count, step = copied(system), len(system.targets), rows.step
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
def misses_contacts(
    plant: Opened, rows: PartRows, system: RowSystem, impulse: Row, speed: Row
) -> float:
    """Return by how much compliant contacts miss their law at most, as a speed."""
    off = 0.0
    for c in range(len(rows.depths)):
        row = len(system.laws) + len(system.targets) - len(rows.depths) + c
        after = rows.depths[c, 1] - 0.5 * rows.step * speed[row]
        force, _ = mean_force(plant, rows.depths[c, 0], after, rows.step)
        off = max(off, abs(rows.step * force - impulse[row]) * system.own[row])
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


@compiled(inside=True)
def solve_part(plant: Opened, rows: PartRows, speed: Row, work: float) -> Solved:
    """Return how the rows of a part end, with every row, flank and coupling on its law.

    Rounds take flanks and compliant contacts as tangents, and coupling as it was in the last one,
    until none of them changes.

    Args:
        plant: what moves.
        rows: of the part; laws and free velocity are those of the solution afterwards.
        speed: v (nv,) before.
        work: share of what `solve_system` may do in an impact.
    """
    size, n, m, gears = len(rows.start), len(speed), len(plant.gears.rows), plant.gears
    system = part_system(rows, plant.obstacles.tangents)
    coupled, loose = len(gears.coupling) > 0, gears.loose and rows.step > 0.0
    soft, laws, last, shifted = len(rows.depths) > 0, system.laws, speed.copy(), rows.free
    tolerance, used, way, missed, taken = tolerance_of(system), 0, 0, 0.0, system
    impulse, row_speed, after, last_x = np.zeros(size), np.empty(size), np.empty(n), np.empty(n)
    room, end = np.zeros((3, m if loose else 0, 5)), np.zeros(m)
    turns = np.zeros((room.shape[1], 3))
    rounds = Rounds(impulse, row_speed, end, room[0], room[1], room[2], turns)
    if coupled:
        laws, shifted = laws.copy(), rows.free.copy()
    if soft:
        copy_to(system.free, row_speed)
    for turn in range(_ROUNDS):
        if coupled:
            lag_coupling(plant, rows, system, speed, last, laws, shifted)
        if loose:
            lean_on_flanks(plant, rows, turn, rounds, system.laws)
        if soft:
            taken = softened(plant, rows, system, row_speed)
        if coupled or gears.loose:
            more, way = solve_system(taken, rows.start, tolerance, work, impulse)
        else:
            more, way = solve_rows(taken, rows.start, tolerance, work, impulse)
        used, missed = used + more, 0.0
        velocity_after(system, rows.lower, shifted, impulse, after)
        speeds_at(system, impulse, last_x, row_speed)
        if way >= UNSOLVED or not (coupled or soft or loose):
            break
        copy_to(impulse, rows.start)
        if loose:
            missed = misses_flanks(plant, rows, system, turn, rounds)
        if soft:
            off = misses_contacts(plant, rows, system, impulse, row_speed)
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
        missed = max(missed, residuals(system, impulse)[0])
    copy_to(shifted, rows.free)
    damped = rounds.passed[:, DAMPED].copy()
    return Solved(impulse, row_speed, after, end, damped, used, way, missed)
