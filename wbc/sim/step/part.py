"""One smooth part of a step: no barrier is hit in it (Moreau's midpoint scheme).

q_m = q + h/2 v;  H(q_m)(v' - v) = h (forces at q_m) + row impulses;  q' = q_m + h/2 v'

On a free base v is the momentum's at each of the three places (`motion`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.compiled import (
    Count,
    Flag,
    Flags,
    Nothing,
    Number,
    OutDense,
    OutFlags,
    OutPlaces,
    OutRow,
    Places,
    Row,
    compiled,
    group,
    local,
    several,
)
from wbc.mechanics.inertia import bias_at
from wbc.mechanics.linear import factor_inertia, halfway, rest_of_way
from wbc.mechanics.momentum import part_on_joints
from wbc.mechanics.newton import (
    PASSIVE,
    UNSOLVED,
    distance,
    solve_system,
    speeds_at,
    velocity_after,
)
from wbc.mechanics.rows import SYSTEM, RowSystem, system_of
from wbc.mechanics.tree import Tree
from wbc.sim.step.arrival import arrive, rigid_ones
from wbc.sim.step.compliant import solve_compliant, stored_at
from wbc.sim.step.contacts import (
    barrier_rows,
    friction_of,
    gaps_at,
    ground_speeds,
    lowest_speeds,
    world_pushes,
)
from wbc.sim.step.gears import (
    gear_laws,
    grip_laws,
    motor_speeds,
    rotor_brings,
    solve_gripped,
)
from wbc.sim.step.motion import to_middle
from wbc.sim.step.pairs import FAR
from wbc.sim.step.tables import (
    ACCURACY,
    BACKWARD,
    COULOMB,
    DEFLECTION,
    FIRST,
    FLIGHT,
    HERTZ,
    INERTIA,
    INVERSE,
    JOINT,
    OPENED,
    PLACED,
    PLANAR,
    PLAY,
    RATIO,
    STIFFNESS,
    TOUCH,
    TREE,
    VISCOUS,
    Flight,
    Opened,
    PlacedTree,
)


class Acting(NamedTuple):
    """What acts on a plant in one part of a step.

    Attributes:
        before: (2 j + c,) barriers closed at the start.
        kept: (2 j + c,) barriers that may close within the part.
        stored: row impulses of the last step in the plant's layout; empty for none.
        v: (nv,) at the start.
        torque: (m,) on the rotors.
        force: (nv,) from effects and from outside.
        friction: (nv,) level of dry friction on the coordinates; empty for none.
        time: [s] at the start.
        step: h [s].
    """

    before: BoolArray
    kept: BoolArray
    stored: FloatArray
    v: FloatArray
    torque: FloatArray
    force: FloatArray
    friction: FloatArray
    time: float
    step: float


class PartRows(NamedTuple):
    """The rows of a part, and what they act on.

    Attributes:
        matrix: G (r, nv): gears, coordinates that rub alone, limits, contact normals and tangents.
        lower: L (nv, nv) with L' L = H_l.
        laws: (m + a, 9) see `RowSystem`.
        targets: (l + k,) lowest speeds.
        frictions: (k,).
        free: v (nv,) without the rows.
        carried: (r,) speeds of the ground along the rows.
        pushed: (k + k d,) the same in the middle, for its work.
        axes: (k (1 + d), 3) of the closed contacts.
        which: (k,) their numbers.
        places: (r,) of the rows among the impulses that a state keeps.
        motor: (m,) speeds of the motor outputs before.
        relative: (m,) the same less those of the joints.
        depths: (k, 2) of compliant contacts at the start and in the middle; empty for rigid ones.
    """

    matrix: FloatArray
    lower: FloatArray
    laws: FloatArray
    targets: FloatArray
    frictions: FloatArray
    free: FloatArray
    carried: FloatArray
    pushed: FloatArray
    axes: FloatArray
    which: IntArray
    places: IntArray
    motor: FloatArray
    relative: FloatArray
    depths: FloatArray


class Solved(NamedTuple):
    """How the rows of a part ended.

    Attributes:
        impulse, speed: (r,).
        after: v (nv,).
        end: (m,) relative speeds of the motor outputs.
        damped: (m,) what soft gears pass beside their springs [N m s].
        used: linear systems solved.
        way: that found it; UNSOLVED or UNDECIDED where none did.
        missed: speed by which a PASSIVE end misses the laws, else zero.
    """

    impulse: FloatArray
    speed: FloatArray
    after: FloatArray
    end: FloatArray
    damped: FloatArray
    used: int
    way: int
    missed: float


ACTING = group(Acting, Flags, Flags, *(Row,) * 5, Number, Number)
ROWS = group(
    PartRows, OutDense, OutDense, OutDense, *(OutRow,) * 5, OutDense, OutPlaces, OutPlaces,
    OutRow, OutRow, OutDense,
)  # fmt: skip
SOLVED = group(Solved, *(OutRow,) * 5, Count, Count, Number)
MIDDLE = several(OutRow, OutRow, OutRow)

UNDECIDED, NO_INERTIA = UNSOLVED + 1, UNSOLVED + 2
"""Self-locking gears may have several solutions; H_l is not positive definite."""

SMOOTH, LANDED = 1, 2
"""A part to the end; one in which a barrier was passed on the way."""

MOTOR, GROUND, MESH, ROTOR, GEAR, FRICTION, CONTACT, NORMAL, TRAFFIC, KINETIC, MISSED = range(11)
"""Work and losses of a part [J]: see `EnergyFlow`; what one contact or stop made; bounds of what
moved; and the speed by which a passive end misses the laws."""

_COUPLING_ROUNDS = 200
_COUPLING_TOLERANCE = 1e-13
_SLOWEST = 1e-9
_FASTEST = 10.0


@compiled(MIDDLE, OutRow, OutPlaces)
def middle_of(out: FloatArray, ends: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q (nq,), v (nv,) of the middle and the rates (2 j + c,) of the start within `out`."""
    return out[ends[11] : ends[12]], out[ends[12] : ends[13]], out[ends[13] : ends[14]]


@compiled(Nothing, TREE, FLIGHT, PLACED, Row, OutRow, counted=False)
def bias_of(
    tree: Tree, flight: Flight, placed: PlacedTree, v: FloatArray, bias: FloatArray
) -> None:
    """Write gravity and the velocity terms (nv,), less those that the momentum accounts for."""
    bias_at(tree.joints, tree.rows, tree.gravity, placed.columns, placed.bodies, v, bias)
    bases, weight = flight.bases, local(3)
    for i in range(len(bases)):
        turn, lever = flight.frames[i, :9].reshape(3, 3), flight.frames[i, 9:]
        for k in range(3):
            weight[k] = -placed.composite[bases[i, JOINT], 0] * tree.gravity[k]
        first, planar = bases[i, FIRST], bases[i, PLANAR] == 1
        part_on_joints(placed.inertia, turn, lever, first, planar, weight, bias)


@compiled(Flag, OPENED, ACTING, Row, OutRow, OutDense)
def free_velocity(
    plant: Opened, acting: Acting, speed: FloatArray, free: FloatArray, lower: FloatArray
) -> bool:
    """Write v + h H_l^-1 (forces) (nv,) and the factor of H_l; False where it is not positive."""
    n = len(speed)
    if not factor_inertia(plant.placed.inertia, lower):
        return False
    bias = np.empty(n)
    bias_of(plant.tree, plant.flight, plant.placed, speed, bias)
    for i in range(n):
        free[i] = acting.step * (acting.force[i] - bias[i])
    halfway(lower, free.reshape(-1, 1))
    rest_of_way(lower, free)
    for i in range(n):
        free[i] += speed[i]
    return True


@compiled(Count, OPENED, Row, OutPlaces, counted=False)
def rubbing_alone(plant: Opened, friction: FloatArray, alone: IntArray) -> int:
    """Write the coordinates that have dry friction and no gear that shares it; return how many."""
    gears, count = plant.gears, 0
    for c in range(len(friction)):
        shared = False
        for i in range(len(gears.rows)):
            own = gears.at[i, 0] == c and gears.numbers[i, BACKWARD] >= 0.0
            shared = shared or (gears.direct and own)
        if friction[c] > 0.0 and not shared:
            alone[count] = c
            count += 1
    return count


@compiled(ROWS, OPENED, ACTING, Flags, Row, Row, Row, OutRow)
def rows_of(
    plant: Opened,
    acting: Acting,
    closed: BoolArray,
    middle: FloatArray,
    speed: FloatArray,
    rate: FloatArray,
    gap: FloatArray,
) -> PartRows:
    """Return the rows of a part; `lower[0, 0]` is no number where H_l is not positive.

    Args:
        plant: whose memory stands in the middle.
        acting: what acts on it.
        closed: (2 j + c,) barriers that hold in the part.
        middle, speed: q (nq,), v (nv,) in the middle.
        rate: (2 j + c,) at which closed contacts opened at the start.
        gap: (2 j + c,) in the middle, to write where any barrier is closed.
    """
    gears, obstacles, step = plant.gears, plant.obstacles, acting.step
    n, m, d, limits = len(speed), len(gears.rows), obstacles.tangents, 2 * len(obstacles.limit_at)
    free, lower = np.empty(n), np.empty((n, n))
    if not free_velocity(plant, acting, speed, free, lower):
        lower[0, 0] = np.nan
    alone = np.empty(n, dtype=np.int64)
    rubbing = rubbing_alone(plant, acting.friction, alone) if len(acting.friction) else 0
    held, touching = 0, 0
    for i in range(len(closed)):
        held += closed[i] and i < limits
        touching += closed[i] and i >= limits
    elements, both = m + rubbing, held + touching
    total = elements + both + d * touching
    matrix, laws = np.empty((total, n)), np.zeros((elements, 9))
    axes, which = np.empty((touching * (1 + d), 3)), np.empty(touching, dtype=np.int64)
    places, carried = np.empty(total, dtype=np.int64), np.zeros(total)
    targets, frictions = np.empty(both), np.empty(touching)
    pushed = np.zeros(touching * (1 + d))
    motor, relative = np.empty(m), np.zeros(m)
    motor_speeds(gears, acting.v, motor)
    gear_laws(gears, motor, acting.torque, acting.friction, step, laws[:m])
    gear_rows, at = gears.rows, gears.at
    for i in range(m):
        places[i] = i
        for c in range(n):
            matrix[i, c] = gear_rows[i, c]
        if at[i, 1] == 1:
            relative[i] = motor[i]
            for c in range(n):
                relative[i] -= gear_rows[i, c] * acting.v[c]
    for i in range(rubbing):
        matrix[m + i], places[m + i] = 0.0, m + alone[i]
        matrix[m + i, alone[i]] = laws[m + i, 3] = laws[m + i, 4] = 1.0
        laws[m + i, 5], laws[m + i, 7] = step * acting.friction[alone[i]], np.inf
    if both > 0:
        now = acting.time + 0.5 * step
        gaps_at(plant, middle, now, gap)
        barrier_rows(plant, closed, elements, matrix, axes, which)
        lowest_speeds(
            plant, closed, acting.kept, rate, gap, speed, step, matrix[elements:], targets
        )
        # Speeds count from the ground's at the end, so that what holds on to it ends at its speed.
        ground_speeds(plant, now, now, axes, which, pushed)
        later = acting.time + step
        ground_speeds(plant, now, later, axes, which, carried[elements + held :])
    depths = np.empty((touching if plant.bounds[HERTZ] > 0.0 else 0, 2))
    for c in range(len(depths)):
        at, opens = limits + which[c], -pushed[c]
        for i in range(n):
            opens += matrix[elements + held + c, i] * speed[i]
        depths[c, 0], depths[c, 1] = 0.5 * step * opens - gap[at], -gap[at]
    for c in range(touching):
        frictions[c] = friction_of(plant, which[c])
    row = elements
    for i in range(len(closed)):
        if closed[i]:
            places[row] = m + n + i
            row += 1
    for c in range(touching):
        for a in range(d):
            places[row] = m + n + len(closed) + d * which[c] + a
            row += 1
    return PartRows(
        matrix, lower, laws, targets, frictions, free, carried, pushed, axes, which, places,
        motor, relative, depths,
    )  # fmt: skip


@compiled(SYSTEM, ROWS, Count)
def part_system(rows: PartRows, tangents: int) -> RowSystem:
    """Return what a part is to its rows."""
    system = system_of(
        rows.matrix, rows.lower, rows.free, rows.laws, rows.targets, rows.frictions, tangents
    )
    for i in range(len(rows.carried)):
        system.free[i] -= rows.carried[i]
    return system


@compiled(Flag, OPENED, OutDense, counted=False)
def undecided(plant: Opened, laws: FloatArray) -> bool:
    """Return whether a rigid self-locking gear turns against its rotor's momentum."""
    found = False
    for i in range(len(plant.gears.rows)):
        law = laws[i]
        fast = max(law[0], -law[1]) > _SLOWEST * law[2]
        found = found or (law[4] < 0.0 and fast)
    return found and not plant.gears.loose and len(plant.gears.coupling) == 0


@compiled(Nothing, OPENED, ROWS, SYSTEM, Row, Row, Row, Number, OutDense, OutRow, counted=False)
def lag_coupling(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    speed: FloatArray,
    last: FloatArray,
    free: FloatArray,
    step: float,
    laws: FloatArray,
    shifted: FloatArray,
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
        free: (nv,) without coupling.
        step: h [s], zero for an impact.
        laws: (m, 9) without coupling, over a step; those of the system are changed.
        shifted: v (nv,) without the rows, to write.
    """
    gears, n, m = plant.gears, len(speed), len(plant.gears.rows)
    for c in range(n):
        shifted[c] = -step * gears.gyration[0, c]
    for i in range(m):
        turned, taken = 0.0, step * gears.gyration[0, n + i]
        for c in range(n):
            turned += gears.rows[i, c] * (last[c] - speed[c])
            taken += gears.coupling[i, c] * (last[c] - speed[c])
        for c in range(n):
            shifted[c] -= gears.coupling[i, c] * turned
        if step > 0.0:
            system.laws[i, 0], system.laws[i, 1] = laws[i, 0] - taken, laws[i, 1] - taken
        elif gears.at[i, 1] == 0:
            brought = gears.numbers[i, INERTIA] * rows.motor[i] - taken
            rotor_brings(gears.numbers[i], brought, system.laws[i])
    halfway(rows.lower, shifted.reshape(-1, 1))
    rest_of_way(rows.lower, shifted)
    for c in range(n):
        shifted[c] += free[c]
    for i in range(len(system.free)):
        system.free[i] = -rows.carried[i]
        for c in range(n):
            system.free[i] += rows.matrix[i, c] * shifted[c]


@compiled(Nothing, OPENED, ROWS, SYSTEM, Row, Row, Number)
def couple(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    speed: FloatArray,
    after: FloatArray,
    step: float,
) -> None:
    """Put the inertial coupling of a solution that ends at `after` v (nv,) into the rows."""
    if len(plant.gears.coupling):
        free, laws = rows.free.copy(), system.laws.copy()
        lag_coupling(plant, rows, system, speed, after, free, step, laws, rows.free)


@compiled(SOLVED, OPENED, ROWS, SYSTEM, Row, Row, Number, Number, Row)
def solve_part(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    speed: FloatArray,
    start: FloatArray,
    step: float,
    work: float,
    given: FloatArray,
) -> Solved:
    """Return how the rows of a part end, with every row, flank and coupling on its law.

    Args:
        plant: what moves.
        rows: of the part.
        system: of these rows; its laws and free speeds are those of the solution afterwards.
        speed: v (nv,) before.
        start: (r,) impulses to start from.
        step: h [s], zero for an impact.
        work: share of what `solve_system` may do in an impact.
        given: (r,) the impulses where they are known already, else empty.
    """
    size, n, m = len(start), len(speed), len(plant.gears.rows)
    impulse, row_speed, after = np.zeros(size), np.zeros(size), np.empty(n)
    end, damped, shifted, used, way = np.zeros(m), np.zeros(m), rows.free.copy(), 0, 0
    fastest, laws, last = 0.0, system.laws.copy(), speed.copy()
    for i in range(size):
        fastest = max(fastest, abs(system.free[i]))
    for i in range(len(system.targets)):
        fastest = max(fastest, system.targets[i])
    tolerance = plant.bounds[ACCURACY] * (1.0 + fastest)
    if len(given):
        impulse[:] = given
    elif undecided(plant, laws):
        way = UNDECIDED
    coupled, moved, short = len(plant.gears.coupling) > 0, 0.0, 0.0
    for _ in range(_COUPLING_ROUNDS if way < UNSOLVED else 0):
        if coupled:
            lag_coupling(plant, rows, system, speed, last, rows.free, step, laws, shifted)
        if len(given) == 0:
            if len(rows.depths):
                more, way, short = solve_compliant(
                    plant, rows.depths, system, rows.relative, step, start, tolerance, impulse,
                    end, damped,
                )  # fmt: skip
            elif step > 0.0:
                more, way, short = solve_gripped(
                    plant.gears, system, rows.relative, step, start, tolerance, impulse, end, damped
                )
            else:
                more, way = solve_system(system, start, tolerance, work, impulse)
            used += more
        velocity_after(system, rows.lower, shifted, impulse, after)
        if not coupled or way >= UNSOLVED:
            break
        moved, largest = 0.0, 0.0
        for c in range(n):
            moved = max(moved, abs(after[c] - last[c]))
            largest = max(largest, abs(last[c]))
        if moved <= _COUPLING_TOLERANCE * (1.0 + largest):
            moved = 0.0
            break
        last[:] = after
    rows.free[:] = shifted
    speeds_at(system.delassus, system.free, impulse, row_speed)
    good = 0.0
    for c in range(n):
        good += after[c]
    if way < UNSOLVED and not np.isfinite(good):
        way = UNSOLVED
    if moved > 0.0 and way < UNSOLVED:  # the coupling did not settle
        way, short = PASSIVE, max(short, moved)
    if way == PASSIVE:
        short = max(short, distance(system, impulse))
    return Solved(impulse, row_speed, after, end, damped, used, way, short)


@compiled(Nothing, OPENED, ACTING, ROWS, SOLVED, OutRow, OutRow, OutRow, counted=False)
def gears_after(
    plant: Opened,
    acting: Acting,
    rows: PartRows,
    solved: Solved,
    motor: FloatArray,
    deflection: FloatArray,
    mesh: FloatArray,
) -> None:
    """Write speeds and deflections (m,) of the motor outputs after the part, and T (m,)."""
    at, motion, half = plant.gears.at, plant.gears.motion, 0.5 * acting.step
    for i in range(len(motor)):
        motor[i] = solved.speed[i] + solved.end[i]
        mesh[i] = solved.impulse[i] + np.sign(motor[i]) * rows.laws[i, 5]
        deflection[i] = 0.0
        if at[i, 1] == 1:
            moved = half * (rows.relative[i] + solved.end[i])
            deflection[i] = motion[i, DEFLECTION] + moved


@compiled(Number, Row, Number, counted=False)
def spring_energy(gear: FloatArray, deflection: float) -> float:
    """Return what a compliant gear stores at a deflection [rad], beyond its play [J]."""
    half = 0.5 * gear[PLAY]
    bent = deflection - min(max(deflection, -half), half)
    stored: float = 0.5 * gear[STIFFNESS] * bent * bent
    return stored


@compiled(
    several(Number, Number),
    OPENED,
    ACTING,
    ROWS,
    SOLVED,
    Count,
    Number,
    Number,
    Number,
    counted=False,
)
def loose_losses(
    plant: Opened,
    acting: Acting,
    rows: PartRows,
    solved: Solved,
    which: int,
    after: float,
    mesh: float,
    lost: float,
) -> tuple[float, float]:
    """Return the losses [J] in the mesh of a loose gear, and between it and the joint.

    A spring's loss is what it takes and does not store, its damper's is that of the final speed,
    like every law's of a step: what the change of speed within the step makes of it is
    discretisation, and part of the residual. A rotor that hits the rigid flank of its
    play jumps within the step, for which impulse times final speed would be wrong by more than
    O(h): there the loss of mesh and flank together is what the rotor gives and the joint does not
    get, and the mesh has no more than that of it. Without a hit that may be less than nothing, by
    the change of speed within the step: then the mesh's loss is that of the final speed. A gear
    that hangs in its play loses nothing.

    Args:
        plant, acting, rows, solved: see `books_of`.
        which: number of the gear.
        after: speed of its motor output after.
        mesh: T.
        lost: [J] in the mesh at the final speed.
    """
    gear, step = plant.gears.numbers[which], acting.step
    before, rate, end = rows.motor[which], rows.relative[which], solved.end[which]
    damped = 0.5 * mesh * (rate + end)
    if gear[STIFFNESS] < np.inf:
        damped += 0.5 * solved.damped[which] * (end - rate)
        place = plant.gears.motion[which, DEFLECTION]
        there = place + 0.5 * step * (rate + end)
        return lost, damped - (spring_energy(gear, there) - spring_energy(gear, place))
    if rows.laws[which, 7] == 0.0:
        return lost, 0.0
    rubbed = step * (gear[COULOMB] * np.sign(after) + gear[VISCOUS] * after)
    pushed = step * gear[RATIO] * acting.torque[which] - rubbed
    stored = 0.5 * gear[INERTIA] * (after * after - before * before)
    balance = 0.5 * (pushed - mesh) * (before + after) - stored
    together = balance + damped
    if together > 0.0:
        own = min(max(balance, 0.0), together)
        return own, together - own
    return lost, 0.0


@compiled(Nothing, OPENED, ACTING, ROWS, SOLVED, Row, Row, Row, OutRow, counted=False)
def books_of(
    plant: Opened,
    acting: Acting,
    rows: PartRows,
    solved: Solved,
    speed: FloatArray,
    motor: FloatArray,
    mesh: FloatArray,
    books: FloatArray,
) -> None:
    """Write work and losses of a part, MOTOR to MISSED, see `EnergyFlow`.

    Args:
        plant: whose memory stands in the middle.
        acting: what acts on it.
        rows: of the part.
        solved: how they end.
        speed: v (nv,) in the middle, before.
        motor: (m,) speeds of the motor outputs after.
        mesh: (m,) T.
        books: (11,) to write.
    """
    step, m, n = acting.step, len(motor), len(speed)
    numbers, at, inertia = plant.gears.numbers, plant.gears.at, plant.placed.inertia
    books[:] = 0.0
    books[MISSED] = solved.missed
    for i in range(m):
        gear, size = numbers[i], abs(motor[i])
        turned = 0.5 * step * gear[RATIO] * (rows.motor[i] + motor[i])
        books[MOTOR] += acting.torque[i] * turned
        books[ROTOR] += step * (gear[COULOMB] + gear[VISCOUS] * size) * size
        gain = gear[INVERSE] if motor[i] * mesh[i] > 0.0 else gear[BACKWARD]
        lost, damped = (gain - 1.0) * mesh[i] * motor[i], 0.0
        if at[i, 1] == 1:
            lost, damped = loose_losses(plant, acting, rows, solved, i, motor[i], mesh[i], lost)
        books[MESH] += lost
        books[GEAR] += damped
    for i in range(len(rows.laws)):
        size = abs(motor[i] if i < m else solved.speed[i])
        books[FRICTION] += (rows.laws[i, 5] + rows.laws[i, 6] * size) * size
    elements, both = len(rows.laws), len(rows.targets)
    limits = both - len(rows.frictions)
    for i in range(elements, len(solved.impulse)):
        push, made = solved.impulse[i], solved.impulse[i] * solved.speed[i]
        ground = rows.pushed[i - elements - limits] if i >= elements + limits else 0.0
        books[GROUND] += push * ground
        if i >= elements + both:
            books[CONTACT] -= made
            continue
        contact = i - elements - limits
        if len(rows.depths) == 0 or contact < 0:
            for a in range(plant.obstacles.tangents if contact >= 0 else 0):
                along = elements + both + contact * plant.obstacles.tangents + a
                made += solved.impulse[along] * solved.speed[along]
            books[NORMAL] = max(books[NORMAL], made)
        mean = -ground
        for c in range(n):
            mean += 0.5 * rows.matrix[i, c] * (speed[c] + solved.after[c])
        if len(rows.depths) and contact >= 0:
            # What the spring does not take is lost; at the speed of the end, as others are.
            stiffness, before = plant.bounds[HERTZ], rows.depths[contact, 0]
            after = rows.depths[contact, 1] - 0.5 * step * solved.speed[i]
            taken = stored_at(stiffness, after) - stored_at(stiffness, before)
            books[CONTACT] += push / step * (after - before) - taken
            continue
        books[CONTACT] += max(-push * mean, 0.0)
    for i in range(len(solved.impulse)):
        # A speed below 10 ACCURACY is rounding; `result` takes 1e-8 of what moves as such.
        speed_of = abs(solved.speed[i]) + 1e9 * plant.bounds[ACCURACY]
        books[TRAFFIC] += abs(solved.impulse[i]) * speed_of
    for c in range(n):
        square = speed[c] * speed[c] + solved.after[c] * solved.after[c]
        books[KINETIC] += abs(inertia[c, c]) * square


@compiled(Count, Row, Row, Number, Count, OutFlags, counted=False)
def hold_or_land(
    pushes: FloatArray, gap: FloatArray, touch: float, rigid: int, closed: BoolArray
) -> int:
    """Write which barriers stay closed, pressed ones or in touch; return LANDED or SMOOTH.

    Args:
        pushes: (l + k,) impulses of the closed limits and normals.
        gap: (2 j + c,) at the end.
        touch: gap up to which a barrier counts as closed; one that is passed by more has landed.
        rigid: number of barriers, those that are compliant left out: they neither close nor land.
        closed: (2 j + c,) to change.
    """
    result, row = SMOOTH, 0
    for i in range(len(gap)):
        if closed[i]:
            closed[i] = gap[i] <= touch or (pushes[row] > 0.0 and gap[i] < FAR)
            closed[i] = closed[i] and i < rigid
            row += 1
        elif gap[i] < -touch and i < rigid:
            result = LANDED
    return result


@compiled(Nothing, OPENED, Row, ACTING, OutRow, OutFlags, counted=False)
def meet_compliant(
    plant: Opened, middle: FloatArray, acting: Acting, gap: FloatArray, closed: BoolArray
) -> None:
    """Let compliant contacts take part that may be met within the part: `_FASTEST` [m/s].

    One that comes faster is met by the part after, deeper in its spring.
    """
    if plant.bounds[HERTZ] > 0.0:
        gaps_at(plant, middle, acting.time + 0.5 * acting.step, gap)
        for i in range(2 * len(plant.obstacles.limit_at), len(closed)):
            closed[i] = gap[i] < 0.5 * acting.step * _FASTEST


@compiled(OutRow, Row, Places)
def recalled(stored: FloatArray, places: IntArray) -> FloatArray:
    """Return the impulses (r,) from which the rows start: the last step's, zeros without one."""
    start = np.zeros(len(places))
    if len(stored):
        for i in range(len(places)):
            start[i] = stored[places[i]]
    return start


@compiled(Nothing, OPENED, Row, Row, Number, Number, Flags, OutRow, counted=False)
def first_half(
    plant: Opened,
    q: FloatArray,
    v: FloatArray,
    time: float,
    half: float,
    closed: BoolArray,
    out: FloatArray,
) -> None:
    """Write the middle of a part into `out`, see `to_middle`."""
    middle, speed, rate = middle_of(out, plant.ends)
    to_middle(plant, q, v, time, half, closed, middle, speed, rate)


@compiled(
    Count, OPENED, Flags, Flags, Row, Row, Row, Row, Row, Row, Number, Number, Row, Flag, OutRow,
    OutFlags,
)  # fmt: skip
def part_of_step(
    plant: Opened,
    before: BoolArray,
    kept: BoolArray,
    stored: FloatArray,
    q: FloatArray,
    v: FloatArray,
    torque: FloatArray,
    force: FloatArray,
    friction: FloatArray,
    time: float,
    step: float,
    given: FloatArray,
    begun: bool,
    out: FloatArray,
    closed: BoolArray,
) -> int:
    """Do both halves from q (nq,), or the second where `first_half` has `begun`.

    Args:
        plant: what moves, and its memory.
        before, kept, stored, v, torque, force, friction, time, step: see `Acting`.
        q: (nq,) at the start.
        given: (r,) row impulses where they are known already, else empty.
        begun: see above.
        out: what `Ended` holds, one after the other, to write.
        closed: (2 j + c,) barriers that stay closed, to write.

    Returns:
        SMOOTH or LANDED, minus that where some overlap is left; ten and more where it failed, ten
        beyond what `Solved.way` says.
    """
    ends = plant.ends
    q_end, v_end, motor = out[: ends[0]], out[ends[0] : ends[1]], out[ends[1] : ends[2]]
    impulse, gap, after = out[ends[2] : ends[3]], out[ends[3] : ends[4]], out[ends[4] : ends[5]]
    mesh, overlap, pushes = out[ends[5] : ends[6]], out[ends[6] : ends[7]], out[ends[7] : ends[8]]
    deflection, books = out[ends[8] : ends[9]], out[ends[9] : ends[10]]
    middle, speed, rate = middle_of(out, ends)
    if not begun:
        to_middle(plant, q, v, time, 0.5 * step, before, middle, speed, rate)
    acting = Acting(before, kept, stored, v, torque, force, friction, time, step)
    for i in range(len(closed)):
        closed[i] = before[i] or kept[i]
    meet_compliant(plant, middle, acting, gap, closed)
    rows = rows_of(plant, acting, closed, middle, speed, rate, gap)
    if not rows.lower[0, 0] > 0.0:
        return 10 + NO_INERTIA
    system = part_system(rows, plant.obstacles.tangents)
    start = recalled(stored, rows.places)
    solved = solve_part(plant, rows, system, speed, start, step, 1.0, given)
    gears_after(plant, acting, rows, solved, motor, deflection, mesh)
    out[ends[10]], out[ends[10] + 1] = solved.used, solved.way
    impulse[:] = 0.0
    for i in range(len(solved.impulse)):
        impulse[rows.places[i]] = solved.impulse[i]
    if solved.way >= UNSOLVED:
        return 10 + solved.way
    books_of(plant, acting, rows, solved, speed, motor, mesh, books)
    for c in range(len(after)):
        after[c] = solved.after[c]
    elements, both = len(rows.laws), len(rows.targets)
    first = elements + both - len(rows.frictions)
    world_pushes(plant, solved.impulse[first:], rows.axes, rows.which, pushes.reshape(-1, 3))
    pressed, moved = solved.impulse[elements : elements + both], np.empty(len(after))
    left = arrive(
        plant, closed, rows.matrix[elements : elements + both], pressed, middle, after, step,
        time + step, q_end, v_end, gap, overlap, moved,
    )  # fmt: skip
    good = 0.0
    for c in range(len(v_end)):
        good += v_end[c]
    if not np.isfinite(good):  # it blew up on the way
        return 10 + NO_INERTIA
    for i in range(len(motor) if plant.gears.loose else 0):
        if plant.gears.at[i, 1] == 1:  # motors stay where they are
            for c in range(len(after)):
                deflection[i] -= plant.gears.rows[i, c] * moved[c]
    result = hold_or_land(pressed, gap, plant.bounds[TOUCH], rigid_ones(plant), closed)
    return -result if left else result


@compiled(
    several(ROWS, SYSTEM, OutRow, OutDense), OPENED, Flags, Flags, Row, Row, Row, Row, Row, Row,
    Number, Number, Row, Row,
)  # fmt: skip
def part_in_rows(
    plant: Opened,
    before: BoolArray,
    kept: BoolArray,
    stored: FloatArray,
    q: FloatArray,
    v: FloatArray,
    torque: FloatArray,
    force: FloatArray,
    friction: FloatArray,
    time: float,
    step: float,
    after: FloatArray,
    motor: FloatArray,
) -> tuple[PartRows, RowSystem, FloatArray, FloatArray]:
    """Return the rows of a part, their system, the start of the rows, and H_l.

    Laws and free speeds are those of a solution where `after` v (nv,) and `motor` (m,) say how it
    ends, else (where these are empty) those without coupling and flanks.
    """
    closed, rate = before.copy(), np.empty(len(before))
    middle, speed = np.empty(len(q)), np.empty(len(v))
    to_middle(plant, q, v, time, 0.5 * step, before, middle, speed, rate)
    acting = Acting(before, kept, stored, v, torque, force, friction, time, step)
    for i in range(len(closed)):
        closed[i] = before[i] or kept[i]
    gap = np.empty(len(closed))
    meet_compliant(plant, middle, acting, gap, closed)
    rows = rows_of(plant, acting, closed, middle, speed, rate, gap)
    system = part_system(rows, plant.obstacles.tangents)
    if len(after):
        couple(plant, rows, system, speed, after, step)
        grip_laws(plant.gears, rows.relative, step, after, motor, system.laws)
    return rows, system, recalled(stored, rows.places), plant.placed.inertia.copy()
