"""The momentum of robots on free bases, kept exactly from the start of a step to its end.

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

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim.step.momentum import momentum_at, part_on_joints, velocity_at

_WORLD = pin.Convention.WORLD
_PLANAR_ORDERS = (("JointModelPX", "JointModelPZ", "JointModelRY"),)


@dataclass(frozen=True, eq=False, slots=True)
class FreeBase:
    """A root that no gear drives and nothing holds.

    Attributes:
        joint: number of its first joint; the tree behind it flies.
        frame: number of the joint whose origin the base turns about.
        first: row of v of its first coordinate.
        planar: whether it is x, z and pitch (three coordinates) and no free flyer (six).
        places: entries of q that shift the base, along the world axes `axes`.
        axes: of those entries.
    """

    joint: int
    frame: int
    first: int
    planar: bool
    places: IntArray
    axes: IntArray


@dataclass(frozen=True, eq=False, slots=True)
class Carried:
    """Momentum and centre of mass of the tree on one free base.

    Attributes:
        momentum: (6,) linear, then angular about the centre of mass, world axes.
        center: (3,) centre of mass [m], world.
        mass: [kg].
    """

    momentum: FloatArray
    center: FloatArray
    mass: float


@dataclass(frozen=True, eq=False, slots=True)
class Middle:
    """A robot in the middle of a smooth part, with the momentum of its start.

    Attributes:
        position: q (nq,).
        velocity: v (nv,).
        centers: (3,) centre of mass per free base.
        frames: per free base its rotation (3, 3) and the way from its origin to the centre of
            mass (3,), world.
    """

    position: FloatArray
    velocity: FloatArray
    centers: list[FloatArray]
    frames: list[tuple[FloatArray, FloatArray]]


def free_bases(robot: Robot) -> tuple[FreeBase, ...]:
    """Return the free bases of `robot`: free flyers, and planar ones of PX, PZ and RY joints.

    None where rotors couple to their housings: part of the momentum is then in their spin, and
    the velocity terms stay explicit.
    """
    if robot.rotors_turn_with_links:
        return ()
    model, driven = robot.model, set(robot.actuated.tolist())
    found = []
    for number in range(1, model.njoints):
        if model.parents[number] != 0:
            continue
        joint = model.joints[number]
        if joint.shortname() == "JointModelFreeFlyer":
            places = np.arange(joint.idx_q, joint.idx_q + 3)
            found.append(FreeBase(number, number, joint.idx_v, False, places, np.arange(3)))
        elif _planar(model, number) and not driven & set(range(joint.idx_v, joint.idx_v + 3)):
            places = np.array([joint.idx_q, joint.idx_q + 1])
            found.append(FreeBase(number, number + 2, joint.idx_v, True, places, np.array([0, 2])))
    return tuple(found)


def _planar(model: Any, number: int) -> bool:
    """Return whether a PX, PZ and RY joint follow each other from `number`, along world axes."""
    if number + 2 >= model.njoints:
        return False
    chain = range(number, number + 3)
    names = tuple(model.joints[i].shortname() for i in chain)
    inner = [i for i in range(1, model.njoints) if model.parents[i] in (number, number + 1)]
    level = all(np.allclose(model.jointPlacements[i].rotation, np.eye(3)) for i in chain)
    return names in _PLANAR_ORDERS and level and inner == [number + 1, number + 2]


def to_middle(
    bases: tuple[FreeBase, ...],
    space: Workspace,
    position: FloatArray,
    velocity: FloatArray,
    half: float,
) -> Middle:
    """Return the robot half a step later with the momentum it has; `space` then stands there.

    The attitude goes by the velocity of the middle (one correction), which makes free rotation of
    second order.
    """
    model, data = space.model, space.data
    if not bases:
        middle = pin.integrate(model, position, half * velocity)
        pin.crba(model, data, middle, _WORLD)
        return Middle(middle, velocity, [], [])
    pin.crba(model, data, position, _WORLD)
    start = [_carried(base, data, data.M, velocity) for base in bases]
    guess = pin.integrate(model, position, half * velocity)
    pin.crba(model, data, guess, _WORLD)
    ahead = _with_momentum(bases, data, start, velocity)
    middle = pin.integrate(model, position, half * ahead)
    centers = _advance(bases, space, start, middle, half)
    pin.crba(model, data, middle, _WORLD)
    frames = [_frame(base, data) for base in bases]
    return Middle(middle, _with_momentum(bases, data, start, velocity), centers, frames)


def standing_at(
    bases: tuple[FreeBase, ...], space: Workspace, position: FloatArray, velocity: FloatArray
) -> Middle:
    """Return the robot at a known middle, without centres of mass; `space` then stands there."""
    pin.crba(space.model, space.data, position, _WORLD)
    return Middle(position, velocity, [], [_frame(base, space.data) for base in bases])


def joint_bias(bases: tuple[FreeBase, ...], space: Workspace, middle: Middle) -> FloatArray:
    """Return gravity and the velocity terms (nv,) at the middle, less those of the momentum.

    `space` must stand at the middle. The rows of a free base hold its weight alone; those of the
    joints what is left of the velocity terms once the base obeys its momentum.
    """
    model, data = space.model, space.data
    bias = np.asarray(pin.nonLinearEffects(model, data, middle.position, middle.velocity))
    for base, (turn, lever) in zip(bases, middle.frames, strict=True):
        weight = -float(data.oYcrb[base.joint].mass) * model.gravity.linear
        part_on_joints(data.M, turn, lever, base.first, base.planar, weight, bias)
    return bias


def from_middle(
    bases: tuple[FreeBase, ...],
    space: Workspace,
    middle: Middle,
    inertia: FloatArray,
    after: FloatArray,
    half: float,
) -> tuple[FloatArray, list[Carried]]:
    """Return q (nq,) half a step after the middle, and the momentum to find v from there.

    Args:
        bases: free bases.
        space: memory.
        middle: where the forces acted.
        inertia: H_l (nv, nv) there, upper half.
        after: v (nv,) there, after the forces.
        half: [s].
    """
    position = pin.integrate(space.model, middle.position, half * after)
    carried = []
    for base, center, frame in zip(bases, middle.centers, middle.frames, strict=True):
        mass = float(space.data.oYcrb[base.joint].mass)
        carried.append(Carried(_momentum(base, inertia, frame, after), center, mass))
    if bases:
        _advance(bases, space, carried, position, half)
    return position, carried


def arrived_velocity(
    bases: tuple[FreeBase, ...], space: Workspace, carried: list[Carried], after: FloatArray
) -> FloatArray:
    """Return v (nv,) with the momentum of `carried`, for the kinematics held in `space`."""
    return _with_momentum(bases, space.data, carried, after) if bases else after


def _frame(base: FreeBase, data: Any) -> tuple[FloatArray, FloatArray]:
    place = data.oMi[base.frame]
    # Copies: pinocchio's are views of memory that moves on.
    return np.array(place.rotation), data.oYcrb[base.joint].lever - place.translation


def _momentum(
    base: FreeBase,
    inertia: FloatArray,
    frame: tuple[FloatArray, FloatArray],
    velocity: FloatArray,
) -> FloatArray:
    momentum = np.empty(6)
    momentum_at(inertia, frame[0], frame[1], base.first, base.planar, velocity, momentum)
    return momentum


def _carried(base: FreeBase, data: Any, inertia: FloatArray, velocity: FloatArray) -> Carried:
    body = data.oYcrb[base.joint]
    momentum = _momentum(base, inertia, _frame(base, data), velocity)
    return Carried(momentum, np.array(body.lever), float(body.mass))


def _with_momentum(
    bases: tuple[FreeBase, ...], data: Any, carried: list[Carried], velocity: FloatArray
) -> FloatArray:
    found = np.array(velocity)
    for base, part in zip(bases, carried, strict=True):
        turn, lever = _frame(base, data)
        velocity_at(data.M, turn, lever, base.first, base.planar, part.momentum, found)
    return found


def _advance(
    bases: tuple[FreeBase, ...],
    space: Workspace,
    carried: list[Carried],
    position: FloatArray,
    half: float,
) -> list[FloatArray]:
    """Move the bases in `position` so that each centre of mass has moved in a straight line."""
    model, data = space.model, space.data
    pin.centerOfMass(model, data, position, True)
    centers = []
    for base, part in zip(bases, carried, strict=True):
        center = part.center + (half / part.mass) * part.momentum[:3]
        missing = center - data.oMi[base.joint].act(data.com[base.joint])
        position[base.places] += missing[base.axes]
        centers.append(center)
    return centers
