"""An impact: barriers that are reached stop the robot at once, and give back what they do.

Newton's restitution with friction may ask for more energy than there was (Kane's paradox), or for
what the joints cannot do. Without restitution an impact only loses energy; towards the share of the
restitution that just does so, a fixed number of tries.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Flags, OutDense, OutRow, Row, compiled, inner
from wbc.mechanics.kinematics import place
from wbc.mechanics.linear import copy_to, dot
from wbc.mechanics.newton import UNSOLVED
from wbc.mechanics.rows import RowSystem
from wbc.sim.step.arrival import rigid_ones
from wbc.sim.step.contacts import gaps_at, world_pushes
from wbc.sim.step.field import AHEAD
from wbc.sim.step.gears import rotor_brings, rotor_energy
from wbc.sim.step.motion import weigh
from wbc.sim.step.part_rows import PartRows, Solved, part_system, rows_where
from wbc.sim.step.solution import NO_INERTIA, solve_part
from wbc.sim.step.tables import BACKWARD, INERTIA, INVERSE, REACH, TOUCH, Opened

APART, RESTING, HIT = range(3)
"""Nothing is reached; reached without speed; an impact."""
MESH, CONTACT, USED, ROWS_OF, SHARE, ENERGY, WAY, LEFT = range(8)
"""Numbers of an impact: losses of gears and contacts [J], linear systems solved, rows, share of the
restitution, the kinetic energy before [J], what `Solved.way` says, and the speed by which a passive
end misses the laws."""
_SLOW = 1e-9
_STOPPED = 1e-9
_SHARE_OF_WORK = 0.1
"""Of what a step may do, for an impact with restitution: there is another without."""


@inner
def impact_laws(plant: Opened, motor: Row, laws: OutDense) -> None:
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


@inner
def kinetic_of(plant: Opened, v: Row, motor: Row) -> float:
    """Return the kinetic energy at v (nv,) with motor outputs at (m,), where the memory stands."""
    energy = rotor_energy(plant.gears, v, motor)
    for i in range(len(v)):
        energy += 0.5 * v[i] * dot(v, plant.placed.inertia[i])
    return energy


@inner
def mesh_loss(plant: Opened, v: Row, after: Row, motor: Row, following: Row, mesh: Row) -> float:
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


@compiled(counted=False)
def gaps_of(plant: Opened, q: Row, gap: OutRow) -> None:
    """Write all gaps (2 j + c,) at q (nq,)."""
    place(plant.tree.joints, plant.tree.shapes, q, plant.placed.poses)
    plant.bounds[REACH] = AHEAD
    gaps_at(plant, q, plant.hit.closed[:0], gap)


@compiled(inside=True)
def impact_rows(plant: Opened, together: Flags, v: Row) -> PartRows:
    """Return the rows of an impact of some barriers (2 j + c,), where the memory stands.

    Their targets are still to be written.
    """
    rows = rows_where(plant, together, v, 0)
    impact_laws(plant, rows.motor, rows.laws)
    return rows


@inner
def reaches(plant: Opened, before: Flags, kept: Flags, q: Row) -> bool:
    """Write the barriers that are reached, and those that take part; return whether there are any.

    Arguments as of `impact_at`. The poses and touches then stand at q.
    """
    hit, gap, found = plant.hit, plant.end.gap, False
    gaps_of(plant, q, gap)
    for i in range(len(before)):
        hit.fresh[i] = not before[i] and gap[i] <= plant.bounds[TOUCH] and i < rigid_ones(plant)
        hit.closed[i] = before[i] or hit.fresh[i] or kept[i]
        found = found or (hit.closed[i] and not before[i])
    return found


@inner
def impact_targets(
    plant: Opened, before: Flags, back: Row, v: Row, left: float, rows: PartRows
) -> bool:
    """Write at which speeds the barriers are to part; return whether one of them is coming.

    Arguments as of `impact_at`; found[SHARE] is one where any springs back.
    """
    hit, row, coming = plant.hit, 0, False
    for i in range(len(before)):
        if not hit.closed[i]:
            continue
        approach = dot(v, rows.matrix[len(rows.laws) + row])
        ahead = not before[i] and not hit.fresh[i]
        least = -2.0 * plant.end.gap[i] / left if ahead else 0.0
        opening = 0.0 if ahead else -back[i] * min(approach, 0.0)
        if opening > 0.0:
            hit.found[SHARE] = 1.0
        coming = coming or (not before[i] and approach < least - _SLOW)
        hit.aims[row] = rows.targets[row] = least + opening
        row += 1
    return coming


@compiled(inside=True)
def book_impact(plant: Opened, v: Row, rows: PartRows, solved: Solved) -> None:
    """Write losses of an impact from v (nv,)."""
    found, following, m = plant.hit.found, rows.motor.copy(), len(rows.motor)
    for i in range(m):
        if plant.gears.at[i, 1] == 0:
            following[i] = dot(solved.after, plant.gears.rows[i])
    mesh = solved.impulse[:m]
    found[MESH] = mesh_loss(plant, v, solved.after, rows.motor, following, mesh)
    kept = kinetic_of(plant, solved.after, following)
    found[CONTACT] = found[ENERGY] - kept - found[MESH]


@compiled
def impact_at(
    plant: Opened,
    before: Flags,
    kept: Flags,
    back: Row,
    q: Row,
    v: Row,
    left: float,
    given: Row,
) -> int:
    """Write the impact on barriers that have just been reached into `plant.hit`, see `settle`.

    Args:
        plant: what moves.
        before: (2 j + c,) barriers that are known to be closed.
        kept: (2 j + c,) barriers that are rows of what is left of the step.
        back: (2 j + c,) restitution of the barriers.
        q, v: (nq,), (nv,).
        left: of the step [s].
        given: (r,) impulses where they are known already, else empty.

    Returns:
        APART, RESTING or HIT; of these only HIT writes speeds and impulses. It failed where
        found[WAY] is UNSOLVED or more; found[SHARE] is zero where nothing springs back.
    """
    hit, gravity = plant.hit, plant.tree.gravity
    found = hit.found
    found[:] = 0.0
    if not reaches(plant, before, kept, q):
        return APART
    weigh(plant.tree, plant.flight, plant.placed)
    rows = impact_rows(plant, hit.closed, v)
    if not rows.lower[0, 0] > 0.0:
        found[WAY] = NO_INERTIA
        return HIT
    if not impact_targets(plant, before, back, v, left, rows):
        for i in range(len(before)):
            hit.closed[i] = before[i] or hit.fresh[i]
        return RESTING
    found[ENERGY] = kinetic_of(plant, v, rows.motor)
    system, start = part_system(rows, plant.obstacles.tangents), np.zeros(len(rows.places))
    work = 1.0 if found[SHARE] == 0.0 else _SHARE_OF_WORK
    solved = solve_part(plant, rows, system, v, start, 0.0, work, given)
    found[USED], found[ROWS_OF] = solved.used, len(solved.impulse)
    found[WAY], found[LEFT] = solved.way, solved.missed
    copy_to(solved.impulse, hit.impulse)
    if solved.way >= UNSOLVED:
        return HIT
    book_impact(plant, v, rows, solved)
    hit.after[:] = solved.after
    contacts = len(rows.laws) + len(rows.targets) - len(rows.which)
    pushes = hit.pushes.reshape(-1, 3)
    world_pushes(plant, solved.impulse[contacts:], rows.axes, rows.which, pushes)
    # What parts so slowly that gravity brings it back within the step stays closed.
    slow = 0.5 * left * np.sqrt(gravity[0] ** 2 + gravity[1] ** 2 + gravity[2] ** 2)
    row = len(rows.laws)
    for i in range(len(before)):
        if hit.closed[i]:
            parts = solved.speed[row] > max(plant.bounds[TOUCH], slow)
            hit.closed[i] = (before[i] or hit.fresh[i]) and not parts
            row += 1
    return HIT


@compiled
def impact_in_rows(
    plant: Opened, together: Flags, q: Row, v: Row, targets: Row
) -> tuple[PartRows, RowSystem, OutDense]:
    """Return the rows of an impact at known targets (l + k,), their system, and H_l.

    Args:
        plant: what moves.
        together: (2 j + c,) barriers that take part.
        q, v: (nq,), (nv,).
        targets: speeds at which they part.
    """
    gaps_of(plant, q, np.empty(len(together)))
    weigh(plant.tree, plant.flight, plant.placed)
    rows = impact_rows(plant, together, v)
    rows.targets[:] = targets
    system = part_system(rows, plant.obstacles.tangents)
    return rows, system, plant.placed.inertia.copy()
