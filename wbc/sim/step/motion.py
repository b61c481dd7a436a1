"""From the start of a part to its middle, and on to its end, with the momentum of free bases.

Over a step the forces change the momentum of the whole tree, not the coordinates in which its base
happens to be described: p' = p + h (weight + outer forces), and the same for the angular momentum
about the centre of mass. A smooth part of a step therefore takes linear and angular momentum from
its start, finds the velocity that carries them at the middle, lets the forces and impulses change
them there, and finds the velocity that carries the result at the end. The centre of mass moves in
a straight line over each half. In free flight both momenta are exact to rounding, for any step,
any base frame and any motion of the joints; what is left of the Coriolis and centrifugal terms is
their part on the joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.arrays import IntArray
from wbc.compiled import OutRow, Row, inner, local
from wbc.mechanics.inertia import bodies_at, composites_of, inertia_at, momentum_at, velocity_at
from wbc.mechanics.kinematics import FRAME, JOINT, PLACES, ROWS, columns_at, moved_along, placed_at
from wbc.mechanics.linear import add_times, copy_to
from wbc.robot import Robot
from wbc.sim.step.contacts import put, rates_at, touch_ground
from wbc.sim.step.tables import Opened

_PLANAR_ORDER = ("JointModelPX", "JointModelPZ", "JointModelRY")


def free_bases(robot: Robot) -> IntArray:
    """Return the free bases (b, 5) of `robot`: free flyers, and planar ones of PX, PZ, RY joints.

    They are roots that no gear drives and nothing holds; columns JOINT to PLACES. None where rotors
    couple to their housings: part of the momentum is then in their spin, and the velocity terms
    stay explicit.
    """
    found: list[tuple[int, int, int, int, int]] = []
    model, driven = robot.model, set(robot.actuated.tolist())
    for number in range(1, model.njoints):
        joint = model.joints[number]
        if model.parents[number] != 0 or robot.rotors_turn_with_links:
            continue
        if joint.shortname() == "JointModelFreeFlyer":
            found.append((number - 1, number - 1, joint.idx_v, 6, joint.idx_q))
        elif _planar(model, number) and not driven & set(range(joint.idx_v, joint.idx_v + 3)):
            found.append((number - 1, number + 1, joint.idx_v, 3, joint.idx_q))
    return np.array(found, dtype=np.int64).reshape(-1, 5)


def _planar(model: Any, number: int) -> bool:
    """Return whether a PX, PZ and RY joint follow each other from `number`, along world axes."""
    if number + 2 >= model.njoints:
        return False
    chain = range(number, number + 3)
    names = tuple(model.joints[i].shortname() for i in chain)
    inner = [i for i in range(1, model.njoints) if model.parents[i] in (number, number + 1)]
    level = all(np.allclose(model.jointPlacements[i].rotation, np.eye(3)) for i in chain)
    return names == _PLANAR_ORDER and level and inner == [number + 1, number + 2]


@inner
def look(plant: Opened) -> None:
    """Write columns and bodies in given poses."""
    tree, placed, about = plant.tree, plant.placed, plant.placed.about
    poses, bases = placed.poses, placed.bases
    copy_to(poses[bases[0, FRAME] if len(bases) else 0, 9:], about)
    columns_at(tree.joints, tree.shapes, poses, about, placed.columns)
    bodies_at(tree.joints, tree.shapes, poses, about, placed.bodies)
    composites_of(tree.joints, placed.bodies, placed.composite)


@inner
def weigh(plant: Opened) -> None:
    """Write columns, bodies and H_l in given poses."""
    look(plant)
    placed = plant.placed
    inertia_at(plant.tree.rows, placed.composite, placed.columns, placed.inertia)


@inner
def carry(plant: Opened, v: Row) -> None:
    """Keep the momentum (6) that every tree on a free base has at v (nv,)."""
    placed = plant.placed
    for i in range(len(placed.bases)):
        root, carried = placed.bases[i, JOINT], placed.carried[i, :6]
        momentum_at(plant.tree, placed.columns, placed.composite, root, v, carried)


@inner
def set_momentum(plant: Opened, v: OutRow) -> None:
    """Change the bases' rows of v (nv,) so that every tree has the momentum that is carried."""
    placed = plant.placed
    for i in range(len(placed.bases)):
        base, carried = placed.bases[i], placed.carried[i, :6]
        velocity_at(plant.tree, placed.columns, placed.composite, base, carried, v)


@inner
def look_and_set(plant: Opened, v: OutRow) -> None:
    """Do `set_momentum` in given poses."""
    look(plant)
    set_momentum(plant, v)


@inner
def advance(plant: Opened, half: float, q: OutRow) -> None:
    """Move the bases in q and poses so that each centre of mass has moved in a straight line.

    Args:
        plant: with poses, momentum and centres of mass; the latter are moved.
        half: time [s] that the centres of mass move on.
        q: (nq,), changed.
    """
    joints, shapes, poses = plant.tree.joints, plant.tree.shapes, plant.placed.poses
    bases, carried = plant.placed.bases, plant.placed.carried
    for i in range(len(bases)):
        joint, missing, center = bases[i, JOINT], local(3), local(3)
        missing[:] = 0.0
        for body in range(len(joints)):
            if joints[body, 4] == joint:
                placed_at(poses[body], shapes[body, 16:19], center)
                add_times(-shapes[body, 15], center, missing)
        for k in range(3):
            carried[i, 6 + k] += half / carried[i, 9] * carried[i, k]
            missing[k] = carried[i, 6 + k] + missing[k] / carried[i, 9]
        if bases[i, ROWS] == 3:
            missing[1] = 0.0
            q[bases[i, PLACES]] += missing[0]
            q[bases[i, PLACES] + 1] += missing[2]
        else:
            add_times(1.0, missing, q[bases[i, PLACES] :])
        for body in range(len(joints)):
            if joints[body, 4] == joint:
                add_times(1.0, missing, poses[body, 9:])


@inner
def to_end(plant: Opened, half: float) -> None:
    """Move q (nq,) and the poses from the middle of a part to its end, half a step later."""
    end = plant.end
    carry(plant, end.after)
    moved_along(plant.tree.joints, end.before, end.after, half, end.position)
    put(plant, end.position)
    advance(plant, half, end.position)


@inner
def to_middle(plant: Opened, half: float) -> None:
    """Write the middle of a part: q (nq,), v (nv,) half a step later, with the same momentum.

    The attitude goes by the velocity of the middle (one correction), which makes free rotation of
    second order. The memory then stands at the middle, with all of H_l. How fast the closed
    contacts open at the start is written beside it, see `rates_at`.
    """
    joints, bases = plant.tree.joints, plant.placed.bases
    q, v, closed = plant.now.position, plant.now.velocity, plant.now.closed
    middle, speed, rate = plant.end.before, plant.end.speed, plant.end.rate
    touching, rate[:] = False, 0.0
    for i in range(plant.obstacles.limits, len(closed)):
        touching = touching or closed[i]
    if len(bases) or touching:
        put(plant, q)
        look(plant)
    if touching:
        touch_ground(plant, closed)
        rates_at(plant, closed, v, rate)
    copy_to(v, speed)
    if len(bases):
        carry(plant, v)
        for i in range(len(bases)):
            behind, carried = plant.placed.composite[bases[i, JOINT]], plant.placed.carried[i]
            carried[9] = behind[0]
            copy_to(plant.placed.about, carried[6:])
            add_times(1.0 / behind[0], behind[1:4], carried[6:])
        moved_along(joints, q, v, half, middle)
        put(plant, middle)
        look_and_set(plant, speed)
    moved_along(joints, q, speed, half, middle)
    put(plant, middle)
    advance(plant, half, middle)
    weigh(plant)
    copy_to(v, speed)
    set_momentum(plant, speed)
