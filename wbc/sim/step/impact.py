"""An impact: barriers that are reached stop the robot at once, and give back what they do.

Newton's restitution with friction may ask for more energy than there was (Kane's paradox), or for
what the joints cannot do. Without restitution an impact only loses energy; towards the share of the
restitution that just does so, a fixed number of tries.
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.compiled import (
    Count,
    Flags,
    Nothing,
    Number,
    OutDense,
    OutFlags,
    OutRow,
    Row,
    compiled,
    several,
)
from wbc.mechanics.kinematics import place
from wbc.mechanics.linear import factor_inertia
from wbc.mechanics.newton import UNSOLVED
from wbc.mechanics.rows import SYSTEM, RowSystem
from wbc.sim.step.arrival import rigid_ones
from wbc.sim.step.contacts import (
    barrier_rows,
    friction_of,
    gaps_at,
    ground_speeds,
    world_pushes,
)
from wbc.sim.step.gears import motor_speeds, rotor_brings
from wbc.sim.step.motion import look
from wbc.sim.step.part import (
    NO_INERTIA,
    ROWS,
    PartRows,
    couple,
    part_system,
    solve_part,
)
from wbc.sim.step.tables import BACKWARD, INERTIA, INVERSE, OPENED, TOUCH, Opened

APART, RESTING, HIT = range(3)
"""Nothing is reached; reached without speed; an impact."""
MESH, CONTACT, USED, ROWS_OF, SHARE, WORK, ENERGY, WAY, LEFT = range(9)
"""Numbers of an impact: losses of gears and contacts [J], linear systems solved, rows, share of the
restitution, what a moving ground gave, the kinetic energy before [J], what `Solved.way` says, and
the speed by which a passive end misses the laws."""
_SLOW = 1e-9
_STOPPED = 1e-9
_SHARE_OF_WORK = 0.1
"""Of what a step may do, for an impact with restitution: there is another without."""


@compiled(Nothing, OPENED, Row, OutDense, counted=False)
def impact_laws(plant: Opened, motor: FloatArray, laws: FloatArray) -> None:
    """Write the laws (m, 9) of the gears along the velocity path of an impact.

    Without motor impulse each gear presents eta_f N^2 I_r while its speed falls towards zero and
    N^2 I_r / eta_b while it grows, from its speed before on, see `rotor_brings`. Coulomb levels
    and springs are forces and give no impulse: loose gears pass none.

    Args:
        plant: with the gears.
        motor: (m,) speeds of the motor outputs before.
        laws: to write, see `RowSystem`.
    """
    laws[:] = 0.0
    for i in range(len(laws)):
        gear, law = plant.gears.numbers[i], laws[i]
        if plant.gears.at[i, 1] == 1:
            law[2] = law[3] = law[4] = 1.0
            continue
        rotor_brings(gear, gear[INERTIA] * motor[i], law)
        law[2], law[3], law[4], law[7] = gear[INERTIA], gear[INVERSE], gear[BACKWARD], np.inf


@compiled(Number, OPENED, Row, Row, counted=False)
def kinetic_of(plant: Opened, v: FloatArray, motor: FloatArray) -> float:
    """Return the kinetic energy at v (nv,) with motor outputs at (m,), where the memory stands."""
    n, inertia, energy = len(v), plant.placed.inertia, 0.0
    for i in range(n):
        for j in range(n):
            energy += 0.5 * inertia[i, j] * v[i] * v[j]
    for g in range(len(motor)):
        energy += 0.5 * plant.gears.numbers[g, INERTIA] * motor[g] * motor[g]
        if len(plant.gears.coupling):
            for j in range(n):
                energy += motor[g] * plant.gears.coupling[g, j] * v[j]
    return energy


@compiled(Number, OPENED, Row, Row, Row, Row, Row, counted=False)
def mesh_loss(
    plant: Opened,
    v: FloatArray,
    after: FloatArray,
    motor: FloatArray,
    following: FloatArray,
    mesh: FloatArray,
) -> float:
    """Return the energy lost in the meshes of the rigid gears along the straight path [J].

    It is what the rotors and their coupling to the housings give and the links do not get: with
    the mesh impulse T and the coupling's C on the rotor, (M (w - w') + C - T) (w + w')/2 per gear.
    A gear that reverses has a bent path: its rotor gives all it has, of which (1 - eta_f) is lost,
    then takes new energy E from the mesh, which costs (1/eta_b - 1) E. A self-locking gear that
    stops carries any more impulse at rest, where it does no work: driving it has lost
    (1 - eta_f) of the rotor's energy, driven it all of that and 1/|eta_b| times as much again.

    Args:
        plant: with the gears.
        v, after: (nv,) before and after.
        motor, following: (m,) speeds of the motor outputs before and after.
        mesh: (m,) impulses T.
    """
    total = 0.0
    for g in range(len(motor)):
        if plant.gears.at[g, 1] == 1:
            continue
        gear, before, then = plant.gears.numbers[g], motor[g], following[g]
        given, taken = 0.5 * gear[INERTIA] * before**2, 0.5 * gear[INERTIA] * then**2
        net, backward, forward = -mesh[g], gear[BACKWARD], 1.0 / gear[INVERSE]
        if len(plant.gears.coupling):
            for j in range(len(v)):
                net -= plant.gears.coupling[g, j] * (after[j] - v[j])
        if backward < 0.0 and abs(then) <= _STOPPED * abs(before):
            total += given * (1.0 - forward if net * before < 0.0 else 1.0 - 1.0 / backward)
        elif before * then < 0.0:
            again = 1.0 / backward if backward > 0.0 else 1.0
            total += (1.0 - forward) * given + (again - 1.0) * taken
        else:
            total += given - taken + 0.5 * net * (before + then)
    return total


@compiled(Nothing, OPENED, Row, Number, OutRow, counted=False)
def gaps_of(plant: Opened, q: FloatArray, time: float, gap: FloatArray) -> None:
    """Write all gaps (2 j + c,) at q (nq,) and a time."""
    place(plant.tree.joints, plant.tree.shapes, q, plant.placed.poses)
    gaps_at(plant, q, time, gap)


@compiled(ROWS, OPENED, Flags, Row, Number)
def impact_rows(plant: Opened, together: BoolArray, v: FloatArray, time: float) -> PartRows:
    """Return the rows of an impact of some barriers (2 j + c,), where the memory stands.

    Their targets are still to be written.
    """
    obstacles, n, m = plant.obstacles, len(v), len(plant.gears.rows)
    d, limits, held, touching = obstacles.tangents, 2 * len(obstacles.limit_at), 0, 0
    for i in range(len(together)):
        held += together[i] and i < limits
        touching += together[i] and i >= limits
    both = held + touching
    total = m + both + d * touching
    matrix, laws, lower = np.empty((total, n)), np.empty((m, 9)), np.empty((n, n))
    axes, which = np.empty((touching * (1 + d), 3)), np.empty(touching, dtype=np.int64)
    carried, frictions, motor = np.zeros(total), np.empty(touching), np.empty(m)
    barrier_rows(plant, together, m, matrix, axes, which)
    ground_speeds(plant, time, time, axes, which, carried[m + held :])
    motor_speeds(plant.gears, v, motor)
    impact_laws(plant, motor, laws)
    for i in range(m):
        for c in range(n):
            matrix[i, c] = plant.gears.rows[i, c]
    for c in range(touching):
        frictions[c] = friction_of(plant, which[c])
    if not factor_inertia(plant.placed.inertia, lower):
        lower[0, 0] = np.nan
    return PartRows(
        matrix, lower, laws, np.zeros(both), frictions, v.copy(), carried, np.zeros(0), axes, which,
        np.zeros(0, dtype=np.int64), motor, np.zeros(m), np.zeros((0, 2)),
    )  # fmt: skip


@compiled(
    Count, OPENED, Flags, Flags, Row, Row, Row, Number, Number, Number, Number, Row,
    OutRow, OutRow, OutRow, OutRow, OutRow, OutFlags, OutFlags,
)  # fmt: skip
def impact_at(
    plant: Opened,
    before: BoolArray,
    kept: BoolArray,
    back: FloatArray,
    q: FloatArray,
    v: FloatArray,
    time: float,
    slow: float,
    left: float,
    share: float,
    given: FloatArray,
    after: FloatArray,
    pushes: FloatArray,
    impulse: FloatArray,
    aims: FloatArray,
    found: FloatArray,
    fresh: BoolArray,
    closed: BoolArray,
) -> int:
    """Write the impact on barriers that have just been reached, see `settle`.

    Args:
        plant: what moves.
        before: (2 j + c,) barriers that are known to be closed.
        kept: (2 j + c,) barriers that are rows of what is left of the step.
        back: (2 j + c,) restitution of the barriers.
        q, v: (nq,), (nv,).
        time: [s].
        slow: speed up to which barriers that part stay closed.
        left: of the step [s].
        share: of the restitution that is given back.
        given: (r,) impulses where they are known already, else empty.
        after: v (nv,) to write.
        pushes: (3 k,) impulses on the contact points, world, to write.
        impulse: of the rows, one after the other, to write; more than there are.
        aims: speeds at which the barriers that take part are to part, in their order, to write.
        found: (9,) numbers MESH to LEFT to write.
        fresh: (2 j + c,) barriers that are reached, to write.
        closed: (2 j + c,) barriers that are closed afterwards, to write.

    Returns:
        APART, RESTING or HIT; of these only HIT writes speeds and impulses. It failed where
        found[WAY] is UNSOLVED or more; found[SHARE] is zero where nothing springs back.
    """
    size, touch = len(before), plant.bounds[TOUCH]
    place(plant.tree.joints, plant.tree.shapes, q, plant.placed.poses)
    gap, ahead, reached, both = np.empty(size), np.zeros(size, dtype=np.bool_), False, 0
    gaps_at(plant, q, time, gap)
    found[:], rigid = 0.0, rigid_ones(plant)
    for i in range(size):
        fresh[i] = not before[i] and gap[i] <= touch and i < rigid
        ahead[i] = kept[i] and not before[i] and not fresh[i]
        closed[i] = before[i] or fresh[i] or ahead[i]
        reached = reached or fresh[i] or ahead[i]
        both += closed[i]
    if not reached:
        return APART
    look(plant.tree, plant.flight, len(v), plant.placed)
    rows = impact_rows(plant, closed, v, time)
    if not rows.lower[0, 0] > 0.0:
        found[WAY] = NO_INERTIA
        return HIT
    least, opening, m = np.zeros(both), np.zeros(both), len(rows.motor)
    row, coming, opens = 0, False, False
    for i in range(size):
        if closed[i]:
            approach = -rows.carried[m + row]
            for c in range(len(v)):
                approach += rows.matrix[m + row, c] * v[c]
            if ahead[i]:
                least[row] = -2.0 * gap[i] / left
            else:
                opening[row] = -back[i] * min(approach, 0.0)
            opens = opens or opening[row] > 0.0
            coming = coming or ((fresh[i] or ahead[i]) and approach < least[row] - _SLOW)
            row += 1
    if not coming:
        for i in range(size):
            closed[i] = closed[i] and not ahead[i]
        return RESTING
    share, carried, had = share if opens else 0.0, 0.0, kinetic_of(plant, v, rows.motor)
    for i in range(both):
        aims[i] = rows.targets[i] = least[i] + share * opening[i]
    system, start = part_system(rows, plant.obstacles.tangents), np.zeros(len(rows.carried))
    work = 1.0 if share == 0.0 else _SHARE_OF_WORK
    solved = solve_part(plant, rows, system, v, start, 0.0, work, given)
    found[USED], found[ROWS_OF], found[ENERGY] = solved.used, len(solved.impulse), had
    found[WAY], found[SHARE], found[LEFT] = solved.way, share, solved.missed
    for i in range(len(solved.impulse)):
        impulse[i] = solved.impulse[i]
        carried += solved.impulse[i] * rows.carried[i]
    if solved.way >= UNSOLVED:
        return HIT
    following, mesh = rows.motor.copy(), solved.impulse[:m]
    for i in range(m):
        if plant.gears.at[i, 1] == 0:
            following[i] = 0.0
            for c in range(len(v)):
                following[i] += plant.gears.rows[i, c] * solved.after[c]
    found[MESH] = mesh_loss(plant, v, solved.after, rows.motor, following, mesh)
    found[CONTACT] = had - kinetic_of(plant, solved.after, following) + carried - found[MESH]
    found[WORK] = carried
    after[:] = solved.after
    first = m + both - len(rows.which)
    world_pushes(plant, solved.impulse[first:], rows.axes, rows.which, pushes.reshape(-1, 3))
    row = m
    for i in range(size):
        if closed[i]:
            closed[i] = solved.speed[row] <= max(touch, slow) and not ahead[i]
            row += 1
    return HIT


@compiled(several(ROWS, SYSTEM, OutDense), OPENED, Flags, Row, Row, Number, Row, Row)
def impact_in_rows(
    plant: Opened,
    together: BoolArray,
    q: FloatArray,
    v: FloatArray,
    time: float,
    targets: FloatArray,
    after: FloatArray,
) -> tuple[PartRows, RowSystem, FloatArray]:
    """Return the rows of an impact at known targets (l + k,), their system, and H_l.

    Args:
        plant: what moves.
        together: (2 j + c,) barriers that take part.
        q, v: (nq,), (nv,).
        time: [s].
        targets: speeds at which they part.
        after: v (nv,) after it where that is known, else empty.
    """
    place(plant.tree.joints, plant.tree.shapes, q, plant.placed.poses)
    gaps_at(plant, q, time, np.empty(len(together)))
    look(plant.tree, plant.flight, len(v), plant.placed)
    rows = impact_rows(plant, together, v, time)
    rows.targets[:] = targets
    system = part_system(rows, plant.obstacles.tangents)
    if len(after):
        couple(plant, rows, system, v, after, 0.0)
    return rows, system, plant.placed.inertia.copy()
