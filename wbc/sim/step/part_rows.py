"""The rows of a part of a step: gears, coordinates that rub, limits and contacts, and what acts.

A part is Moreau's midpoint scheme, in which no barrier is hit:

    q_m = q + h/2 v;  H(q_m)(v' - v) = h (forces at q_m) + row impulses;  q' = q_m + h/2 v'

On a free base v is the momentum's at each of the three places (`part`). The rows are put together
in the middle. An impact has the same rows, but for its laws and targets. The inertial coupling of
rotors and housings is in no law of a row: rounds of the solution take it from the last iterate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Row, inner
from wbc.effects.tables import fill_delivered, fill_torques, near_rest
from wbc.mechanics.inertia import move_bodies, part_on_joints
from wbc.mechanics.kinematics import JOINT
from wbc.mechanics.laws import DAMPING, END, STIFFNESS, begin_flank, own_speed
from wbc.mechanics.linear import add_times, copy_to, dot, factor_inertia, rest_of_way, solve_inertia
from wbc.mechanics.memory import reserve, row_copy, row_of, table_copy, table_of, whole_of, zeros_of
from wbc.mechanics.newton import PASSIVE, SEVERAL, UNSOLVED, residual, solve_laws, speeds_at
from wbc.mechanics.rows import RowSystem, system_of
from wbc.sim.step.contacts import barrier_rows, gaps_at, lowest_speeds
from wbc.sim.step.self_locking import solve_rows
from wbc.sim.step.tables import DISSIPATION, HERTZ, Gears, Opened
from wbc.structures import WORDS, kept, structured

NO_INERTIA = SEVERAL + 1
"""H_l is not positive definite."""
USED, WAY, MISSED = range(3)
"""Of a solution: linear systems solved, what found it, and the speed by which a passive one misses
the laws, else zero."""

_FASTEST = 10.0
_ROUNDS = 200
_COUPLING_TOLERANCE = 1e-13


@structured
class PartRows(NamedTuple):
    """The rows of a part, and what they act on.

    Attributes:
        matrix: G (r, nv): gears, coordinates that rub alone, limits, contact normals and tangents.
        lower: L (nv, nv) with L' L = H_l.
        laws: (m + a, 9) see `RowSystem`.
        targets: (l + k,) lowest speeds.
        frictions: (k,).
        free: v (nv,) without the rows.
        axes: (3 k, 3) of the closed contacts.
        held: (l + k,) numbers of the closed barriers, limits first.
        places: (r,) of the rows among the impulses that a state keeps.
        motor: (m,) speeds of the motor outputs before.
        relative: (m,) the same less those of the joints.
        flanks: (m + a + k, 9) see `RowSystem`; empty where nothing gives way.
        start: (r,) impulses from which the solution starts.
        impulse, speed: (r,) at which the rows end.
        end: (m,) relative speeds of the motor outputs then.
        step: h [s], zero for an impact.
    """

    matrix: OutDense
    lower: OutDense
    laws: OutDense
    targets: OutRow
    frictions: OutRow
    free: OutRow
    axes: OutDense
    held: OutPlaces
    places: OutPlaces
    motor: OutRow
    relative: OutRow
    flanks: OutDense
    start: OutRow
    impulse: OutRow
    speed: OutRow
    end: OutRow
    step: float


@inner
def motor_speeds(gears: Gears, v: Row, loose: Row, speed: OutRow) -> None:
    """Write the speeds (m,) of the motor outputs at v (nv,); those of loose gears are `loose`."""
    for i in range(len(speed)):
        speed[i] = loose[i] if gears.yields[i] else dot(v, gears.rows[i])


@inner
def gear_laws(plant: Opened, speed: Row, step: float, laws: OutDense) -> None:
    """Write the laws (m, 9) of the gears over a step: what rotors bring along, and their losses.

    Args:
        plant: with the gears, and the forces.
        speed: (m,) of the motor outputs before the step.
        step: h [s].
        laws: to write, see `RowSystem`.
    """
    gears, forces = plant.gears, plant.forces
    for i in range(len(speed)):
        law, rubs = laws[i], step * gears.coulomb[i]
        brought = step * gears.ratio[i] * plant.end.torque[i] + gears.inertia[i] * speed[i]
        law[0], law[1], law[2] = brought - rubs, brought + rubs, gears.inertia[i]
        law[2] += step * gears.viscous[i]
        law[3], law[4], law[5], law[6] = gears.inverse[i], gears.backward[i], 0.0, 0.0
        rest, slowness = forces.gears[i, 0], forces.gears[i, 1]
        if rest > 0.0:
            share = near_rest(dot(plant.end.speed, gears.rows[i]), rest, slowness)
            law[3], law[4] = law[3] / (1.0 - share), law[4] / (1.0 + share)
        if gears.row[i] >= 0:
            law[5] = step * forces.friction[gears.row[i]]
        law[7], law[8] = np.inf, 0.0


@inner
def rotor_brings(gears: Gears, which: int, brought: float, law: OutRow) -> None:
    """Write what a rotor brings along an impact's path, in its direction and in the other one.

    Ending up in the other direction it brings eta_f eta_b M w_before, where a step, which only
    knows its end, takes all of M w_before. So the law is monotone, whatever is brought.

    Args:
        gears, which: all of them, and the number of this one.
        brought: M w_before, less what the housing takes [N m s].
        law: (9,) whose first two numbers are written, see `RowSystem`.
    """
    kept = max(gears.backward[which], 0.0) / gears.inverse[which] * brought
    law[0] = brought if brought > 0.0 else kept
    law[1] = brought if brought < 0.0 else kept


@inner
def rotor_energy(gears: Gears, v: Row, motor: Row) -> float:
    """Return what rotors add to the kinetic energy at v (nv,), with motor outputs at (m,)."""
    energy = 0.0
    for g in range(len(motor)):
        energy += 0.5 * gears.inertia[g] * motor[g] * motor[g]
        if len(gears.coupling):
            energy += motor[g] * dot(v, gears.coupling[g])
    return energy


@inner
def free_velocity(plant: Opened, rows: PartRows) -> None:
    """Write v + h H_l^-1 (forces) (nv,) of the middle.

    Of gravity and the velocity terms, those count that the momentum of free bases does not have.
    """
    tree, placed, bases = plant.tree, plant.placed, plant.placed.bases
    free, speed, columns, count = rows.free, plant.end.speed, placed.columns, len(tree.joints)
    motion, drift = table_of(plant.heap, count, 6), table_of(plant.heap, count, 6)
    force, bias = table_of(plant.heap, count, 6), row_of(plant.heap, len(free))
    move_bodies(
        tree.joints, tree.gravity, columns, placed.bodies, speed, motion, drift, force, bias
    )
    for i in range(len(bases)):
        own = force[bases[i, JOINT]]
        part_on_joints(tree, columns, placed.composite, bases[i], placed.inertia, own, bias)
    for i in range(len(free)):
        free[i] = rows.step * (plant.end.force[i] - bias[i])
    solve_inertia(rows.lower, free)
    add_times(1.0, speed, free)


@inner
def rows_where(plant: Opened, rubbing: int, step: float) -> PartRows:
    """Return rows where the memory stands: their directions, and how the motors move before.

    Laws, targets and speeds are still to be written, and the rows of `rubbing` coordinates.
    `lower[0, 0]` is no number where H_l is not positive.
    """
    gears, obstacles, v, closed = plant.gears, plant.obstacles, plant.now.velocity, plant.end.closed
    n, m, limits = len(v), len(gears.rows), obstacles.limits
    both, touching, heap = 0, 0, plant.heap
    for i in range(len(closed)):
        both, touching = both + closed[i], touching + (closed[i] and i >= limits)
    elements = m + rubbing
    total = elements + both + 2 * touching
    yields = step > 0.0 and (gears.loose or plant.bounds[HERTZ] > 0.0)
    count = n + m + len(plant.tree.joints)
    reserve(heap, (total + n) * (2 * n + 150) + 100 * count + 20 * WORDS)
    found = PartRows(
        table_of(heap, total, n), table_of(heap, n, n), table_of(heap, elements, 9),
        zeros_of(heap, both), row_of(heap, touching), row_copy(heap, v),
        table_of(heap, touching * 3, 3), whole_of(heap, both), whole_of(heap, total),
        row_of(heap, m), zeros_of(heap, m), table_of(heap, elements + touching if yields else 0, 9),
        zeros_of(heap, total), zeros_of(heap, total), row_of(heap, total), zeros_of(heap, m), step,
    )  # fmt: skip
    rows = kept(whole_of(heap, WORDS), found)
    rows.laws[:], row = 0.0, 0
    for i in range(len(closed)):
        if closed[i]:
            rows.held[row], row = i, row + 1
    for i in range(m):
        joint, rows.places[i] = dot(v, gears.rows[i]), i
        rows.motor[i] = plant.now.motor_speed[i] if gears.yields[i] else joint
        rows.relative[i] = rows.motor[i] - joint
        copy_to(gears.rows[i], rows.matrix[i])
    barrier_rows(plant, rows.held, elements, rows.matrix, rows.axes)
    for row in range(both):
        rows.places[elements + row] = m + n + rows.held[row]
    for c in range(touching):
        which, row = rows.held[both - touching + c] - limits, elements + both + 2 * c
        rows.frictions[c] = obstacles.frictions[which]
        for a in range(2):
            rows.places[row + a] = m + n + len(closed) + 2 * which + a
    if not factor_inertia(plant.placed.inertia, rows.lower):
        rows.lower[0, 0] = np.nan
    return rows


@inner
def flanks_of(plant: Opened, rows: PartRows) -> None:
    """Write the flanks of loose gears and of compliant contacts, see `RowSystem`.

    A search begins where the contacts are deepest.
    """
    gears, flanks, step = plant.gears, rows.flanks, rows.step
    elements, limits = len(rows.laws), len(rows.targets) - len(rows.frictions)
    flanks[:] = 0.0
    flanks[:, STIFFNESS] = np.inf
    for i in range(len(flanks)):
        own, row = flanks[i], limits + i
        if i < len(gears.rows) and gears.yields[i]:
            own[STIFFNESS], own[DAMPING] = gears.stiffness[i], gears.damping[i]
            begin_flank(own, 0.5 * gears.play[i], plant.now.deflection[i], rows.relative[i], step)
        elif i >= elements and plant.bounds[HERTZ] > 0.0:
            own[STIFFNESS], own[DAMPING] = plant.bounds[HERTZ], plant.bounds[DISSIPATION]
            rate = -dot(plant.end.speed, rows.matrix[row])
            deep = -plant.end.gap[rows.held[row - elements]] - 0.5 * step * rate
            begin_flank(own, -1.0, deep, rate, step)
            own[END] = -dot(rows.free, rows.matrix[row])


@inner
def rows_of(plant: Opened, step: float) -> PartRows:
    """Return the rows of a part, which start from the last step's impulses.

    Where H_l is not positive, `lower[0, 0]` is no number. Compliant contacts take part that may be
    met within it: `_FASTEST` [m/s]. One that comes faster is met by the part after, deeper in its
    spring.

    Args:
        plant: whose memory stands in the middle; forces there are written, which barriers hold, and
            gaps where any does.
        step: h [s].
    """
    gears, forces, end, before, rubbing = plant.gears, plant.forces, plant.end, plant.now.closed, 0
    dry, row, soft, asked = forces.friction, len(gears.rows), plant.bounds[HERTZ] > 0.0, False
    fill_torques(forces.joints, forces.numbers, end.before, end.speed, end.force, dry)
    fill_delivered(forces.drives, forces.command, end.torque)
    add_times(1.0, forces.external, end.force)
    add_times(1.0, forces.outer, end.force)
    add_times(1.0, forces.dry, dry)
    add_times(1.0, forces.added, end.torque)
    for c in range(len(dry)):
        rubbing += gears.alone[c] and dry[c] > 0.0
    for i in range(len(before)):
        end.closed[i] = before[i] or end.kept[i]
        asked = asked or soft or end.closed[i]
    if asked:
        gaps_at(plant, end.before, before[:0] if soft else end.closed, end.gap)
    for i in range(plant.obstacles.limits, len(before) if soft else 0):
        end.closed[i] = end.gap[i] < 0.5 * step * _FASTEST
    rows = rows_where(plant, rubbing, step)
    free_velocity(plant, rows)
    gear_laws(plant, rows.motor, step, rows.laws)
    for c in range(len(dry) if rubbing else 0):
        if gears.alone[c] and dry[c] > 0.0:
            law, rows.matrix[row], rows.places[row] = rows.laws[row], 0.0, len(gears.rows) + c
            rows.matrix[row, c] = law[3] = law[4] = 1.0
            law[5], law[7], row = step * dry[c], np.inf, row + 1
    lowest_speeds(plant, rows.held, step, rows.matrix[row:], rows.targets)
    if len(rows.flanks) > 0:
        flanks_of(plant, rows)
    for i in range(len(rows.start)):
        rows.start[i] = plant.now.impulse[rows.places[i]]
    return rows


@inner
def impact_rows(plant: Opened) -> PartRows:
    """Return the rows of an impact of the barriers that take part, where the memory stands.

    Without motor impulse each gear presents eta_f N^2 I_r while its speed falls towards zero and
    N^2 I_r / eta_b while it grows, from its speed before on, see `rotor_brings`. Coulomb levels
    and springs are forces and give no impulse: loose gears pass none. Self-locking gears go on from
    what they carried before. The targets are still to be written.
    """
    gears, rows = plant.gears, rows_where(plant, 0, 0.0)
    for i in range(len(rows.laws)):
        law = rows.laws[i]
        if gears.yields[i]:
            law[2] = law[3] = law[4] = 1.0
            continue
        law[2], law[3], law[4] = gears.inertia[i], gears.inverse[i], gears.backward[i]
        law[7] = np.inf
        rotor_brings(gears, i, law[2] * rows.motor[i], law)
        if law[4] < 0.0:
            rows.start[i] = plant.now.impulse[i]
    return rows


@inner
def world_pushes(plant: Opened, rows: PartRows) -> None:
    """Write the impulse on every contact point, and on the first hull of every pair (3 (k + p),).

    In world axes, from the rows of a part or an impact.
    """
    obstacles, count, axes = plant.obstacles, len(rows.frictions), rows.axes
    limits, pushes = len(rows.targets) - count, plant.end.pushes
    first, impulse = len(rows.laws) + limits, rows.impulse
    pushes[:] = 0.0
    for c in range(count):
        which = rows.held[limits + c] - obstacles.limits
        pushed = pushes[3 * obstacles.sides[which, 2] :]
        add_times(impulse[first + c], axes[c * 3], pushed)
        for a in range(2):
            along = impulse[first + count + c * 2 + a]
            add_times(along, axes[c * 3 + 1 + a], pushed)


@inner
def lag_coupling(
    gears: Gears, rows: PartRows, system: RowSystem, v: Row, last: Row, laws: Dense, shifted: OutRow
) -> None:
    """Put the inertial coupling of rotors and housings at a last iterate into the rows.

    The rotor's momentum is I_r (phi_dot + a'J_omega v), so a change of v asks the impulse N C dv of
    the rotor (at the motor output, C = I_r a'J_omega) and a change of its spin asks C' N dw of the
    links. Both are taken from the last iterate; the iteration contracts by about the share of rotor
    in link inertia.

    Args:
        gears: with `coupling` and `gyration`.
        rows: of the part.
        system: of the rows, whose free speeds are changed.
        v: (nv,) before.
        last: v (nv,) of the last iterate.
        laws: (m, 9) without coupling, over a step; those of the system are changed.
        shifted: v (nv,) without the rows, to write.
    """
    n, m, step = len(v), len(gears.rows), rows.step
    for c in range(n):
        shifted[c] = -step * gears.gyration[0, c]
    for i in range(m):
        turned, taken = 0.0, step * gears.gyration[0, n + i]
        for c in range(n):
            turned += gears.rows[i, c] * (last[c] - v[c])
            taken += gears.coupling[i, c] * (last[c] - v[c])
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
    """Write how the rows of a part end, with every row on its law.

    Args:
        plant: what moves; `after`, `pushes` and `work` of its end are written.
        rows: of the part; laws and free velocity are those of the solution afterwards.
        speed: v (nv,) before.
        work: share of what `solve_laws` may do in an impact.

    Returns:
        what found it; UNSOLVED or more where nothing did.
    """
    gears, heap = plant.gears, plant.heap
    coupled, taken = len(gears.coupling) > 0, heap.used[0]
    system = system_of(
        heap, rows.matrix, rows.lower, rows.free, rows.laws, rows.flanks, rows.targets,
        rows.frictions,
    )  # fmt: skip
    laws, last, shifted = system.laws, row_copy(heap, speed), rows.free
    used, way, missed = 0, 0, 0.0
    impulse, after, work_of = rows.impulse, plant.end.after, plant.end.work
    if coupled:
        laws, shifted = table_copy(heap, laws), row_copy(heap, rows.free)
    begun = heap.used[0]
    for _ in range(_ROUNDS if coupled else 1):
        heap.used[0] = begun
        if coupled:
            lag_coupling(gears, rows, system, speed, last, laws, shifted)
        if coupled or gears.loose:
            more, way = solve_laws(system, rows.start, work, impulse)
        else:
            more, way = solve_rows(system, rows.start, work, impulse)
        used += more
        speeds_at(system, impulse, after, rows.speed)
        rest_of_way(rows.lower, after)
        add_times(1.0, shifted, after)
        if way >= UNSOLVED or not coupled:
            break
        copy_to(impulse, rows.start)
        missed = settles(after, last)
        copy_to(after, last)
        if missed == 0.0:
            break
    if way < UNSOLVED and not np.isfinite(np.sum(after)):
        way = UNSOLVED
    if missed > 0.0 and way < UNSOLVED:  # the rounds end before all is settled
        way, missed = PASSIVE, max(missed, system.tolerance)
    if way == PASSIVE or len(rows.flanks) > 0:
        off = residual(system, impulse)  # springs of flanks are those of the solution then
        missed = max(missed, off if way == PASSIVE else 0.0)
    for i in range(len(gears.rows) if len(rows.flanks) > 0 else 0):
        if gears.yields[i]:
            own = own_speed(system.laws[i], system.slope[i], impulse[i], rows.speed[i])
            rows.end[i] = own - rows.speed[i]
    copy_to(shifted, rows.free)
    world_pushes(plant, rows)
    heap.used[0] = taken
    work_of[USED], work_of[WAY], work_of[MISSED] = used, way, missed
    return way
