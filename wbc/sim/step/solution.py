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

from wbc.compiled import OutDense, OutRow, Row, ask, compiled, inner
from wbc.mechanics.linear import add_times, dot, solve_inertia
from wbc.mechanics.newton import (
    PASSIVE,
    UNSOLVED,
    distance,
    solve_system,
    speeds_at,
    tolerance_of,
    velocity_after,
)
from wbc.mechanics.rows import RowSystem
from wbc.sim.step.flanks import solve_gripped
from wbc.sim.step.gears import rotor_brings
from wbc.sim.step.part_rows import PartRows, Solved
from wbc.sim.step.tables import DISSIPATION, HERTZ, Opened

UNDECIDED, NO_INERTIA = UNSOLVED + 1, UNSOLVED + 2
"""Self-locking gears may have several solutions; H_l is not positive definite."""

_COUPLING_ROUNDS = 200
_COUPLING_TOLERANCE = 1e-13
_SLOWEST = 1e-9
_CONTACT_ROUNDS = 60
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


@compiled(inside=True)
def solve_compliant(
    plant: Opened, rows: PartRows, system: RowSystem, tolerance: float, solved: Solved
) -> tuple[int, int, float]:
    """Solve the rows of a part with compliant contacts.

    Args:
        plant: what moves.
        rows, system, tolerance, solved: see `solve_gripped`.

    Returns:
        see `solve_gripped`.
    """
    depths, step, impulse = rows.depths, rows.step, solved.impulse
    count, contacts = len(system.targets), len(depths)
    first, work, m = count - contacts, 0, len(system.laws)
    delassus, slope = system.delassus.copy(), system.slope.copy()
    targets, speed, guess = system.targets.copy(), system.free.copy(), rows.start.copy()
    softer = RowSystem(
        system.half, np.empty((0, 0)), delassus, system.free, system.spring, slope,
        system.laws, targets, system.frictions, system.grips, system.tangents,
    )  # fmt: skip
    for _ in range(_CONTACT_ROUNDS):
        for c in range(contacts):
            row = m + first + c
            after = depths[c, 1] - 0.5 * step * speed[row]
            force, rise = mean_force(plant, depths[c, 0], after, step)
            stiff, push = 0.5 * step * step * rise, step * force
            own = system.delassus[row, row]
            give = 1.0 / stiff if stiff > 1e-12 / own else 0.0
            delassus[row, row] = own + give
            slope[row] = 1.0 / (own + give)
            targets[first + c] = speed[row] + push * give if give > 0.0 else NEVER
        used, way, missed = solve_gripped(plant, rows, softer, guess, tolerance, solved)
        work += used
        if way >= UNSOLVED:
            return work, way, missed
        guess[:] = impulse
        speeds_at(system.delassus, system.free, impulse, speed)
        off = 0.0
        for c in range(contacts):
            row = m + first + c
            after = depths[c, 1] - 0.5 * step * speed[row]
            force, _ = mean_force(plant, depths[c, 0], after, step)
            off = max(off, abs(step * force - impulse[row]) * system.delassus[row, row])
        if off <= tolerance:
            return work, way, missed
    return work, UNSOLVED, 0.0


@inner
def undecided(plant: Opened, laws: OutDense) -> bool:
    """Return whether a rigid self-locking gear turns against its rotor's momentum."""
    found = False
    for i in range(len(plant.gears.rows)):
        law = laws[i]
        fast = max(law[0], -law[1]) > _SLOWEST * law[2]
        found = found or (law[4] < 0.0 and fast)
    return found and not plant.gears.loose and len(plant.gears.coupling) == 0


@compiled(inside=True)
def decided(plant: Opened) -> OutRow:
    """Return the impulses (r,) that Python finds for rows with self-locking gears; none if none."""
    impulse, count = plant.hit.impulse, 0
    impulse[:] = np.nan
    ask(plant.forces.undecided)
    while count < len(impulse) and impulse[count] == impulse[count]:
        count += 1
    return impulse[:count]


@inner
def lag_coupling(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    speed: Row,
    last: Row,
    laws: OutDense,
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
def solve_part(
    plant: Opened, rows: PartRows, system: RowSystem, speed: Row, work: float, given: Row
) -> Solved:
    """Return how the rows of a part end, with every row, flank and coupling on its law.

    Args:
        plant: what moves.
        rows: of the part.
        system: of these rows; its laws and free speeds are those of the solution afterwards.
        speed: v (nv,) before.
        work: share of what `solve_system` may do in an impact.
        given: (r,) the impulses where they are known already, else empty.
    """
    size, n, m = len(rows.start), len(speed), len(plant.gears.rows)
    room = Solved(np.zeros(size), np.zeros(size), np.empty(n), np.zeros(m), np.zeros(m), 0, 0, 0.0)
    impulse, after, shifted, used, way = room.impulse, room.after, rows.free.copy(), 0, 0
    tolerance, laws, last = tolerance_of(system), system.laws.copy(), speed.copy()
    if len(given):
        impulse[:] = given
    elif undecided(plant, laws):
        way = UNDECIDED
    coupled, moved, short = len(plant.gears.coupling) > 0, 0.0, 0.0
    for _ in range(_COUPLING_ROUNDS if way < UNSOLVED else 0):
        if coupled:
            lag_coupling(plant, rows, system, speed, last, laws, shifted)
        if len(given) == 0:
            more = 0
            if len(rows.depths):
                more, way, short = solve_compliant(plant, rows, system, tolerance, room)
            elif rows.step > 0.0:
                start = rows.start
                more, way, short = solve_gripped(plant, rows, system, start, tolerance, room)
            else:
                more, way = solve_system(system, rows.start, tolerance, work, impulse)
            used += more
        velocity_after(system, rows.lower, shifted, impulse, after)
        if not coupled or way >= UNSOLVED:
            break
        moved = settles(after, last)
        if moved == 0.0:
            break
        last[:] = after
    rows.free[:] = shifted
    speeds_at(system.delassus, system.free, impulse, room.speed)
    if way < UNSOLVED and not np.isfinite(np.sum(after)):
        way = UNSOLVED
    if moved > 0.0 and way < UNSOLVED:  # the coupling did not settle
        way, short = PASSIVE, max(short, moved)
    if way == PASSIVE:
        short = max(short, distance(system, impulse))
    return Solved(impulse, room.speed, after, room.end, room.damped, used, way, short)
