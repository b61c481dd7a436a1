"""A robot's links, contact points and numbers per joint, as model files want them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import RobotError
from wbc.export.joint_numbers import JointNumbers
from wbc.robot import ContactPoint, Robot

_FREE = "JointModelFreeFlyer"


@dataclass(frozen=True, eq=False)
class LinkEntry:
    """One link with the joint that carries it.

    Attributes:
        name: of the link.
        joint: name of the joint.
        parent: name of the link that it hangs on, "" for the world.
        placement: of the joint in the parent.
        kind: `free`, `hinge` or `slide`.
        axis: (3,) of a hinge or slide, in the link; zeros for a free one.
        inertia: of the link, in the frame of its joint.
        limits: (low, high) [rad, m], infinite where there are none.
        row: of its velocity in v.
    """

    name: str
    joint: str
    parent: str
    placement: pin.SE3
    kind: str
    axis: FloatArray
    inertia: pin.Inertia
    limits: tuple[float, float]
    row: int


def links(robot: Robot) -> list[LinkEntry]:
    """Return the links from the root on, parents first.

    Raises:
        RobotError: a joint that is neither a free base nor has one degree of freedom.
    """
    model, names = robot.model, ["", *robot.bodies]
    found = []
    for number, joint in enumerate(robot.joints, 1):
        kind, axis = _kind(robot, number)
        limits = (-np.inf, np.inf)
        if kind != "free" and model.joints[number].nq == 1:
            row = robot.position_index(joint)
            limits = float(model.lowerPositionLimit[row]), float(model.upperPositionLimit[row])
        found.append(
            LinkEntry(
                name=names[number],
                joint=joint,
                parent=names[model.parents[number]],
                placement=model.jointPlacements[number],
                kind=kind,
                axis=axis,
                inertia=model.inertias[number],
                limits=limits if limits[0] < limits[1] else (-np.inf, np.inf),
                row=int(model.joints[number].idx_v),
            )
        )
    return found


def points(robot: Robot) -> Iterator[tuple[ContactPoint, str, FloatArray]]:
    """Yield each contact point with its link ("" for the world) and its place (3,) in it."""
    model, names = robot.model, ["", *robot.bodies]
    for contact in robot.contacts:
        frame = model.frames[model.getFrameId(contact.frame)]
        place = (frame.placement * contact.placement()).translation
        yield contact, names[frame.parentJoint], place


def _kind(robot: Robot, number: int) -> tuple[str, FloatArray]:
    joint = robot.model.joints[number]
    if joint.shortname() == _FREE:
        return "free", np.zeros(3)
    if joint.nv != 1:
        raise RobotError(
            f"joint '{robot.joints[number - 1]}' of '{robot.name}' has {joint.nv} degrees of "
            "freedom; only a free base and joints with one can be exported."
        )
    data = joint.createData()
    joint.calc(data, np.asarray(pin.neutral(robot.model))[joint.idx_q : joint.idx_q + joint.nq])
    subspace = np.asarray(data.S).reshape(6, -1)[:, 0]
    slides = bool(np.linalg.norm(subspace[:3]) > 0.5)
    return ("slide" if slides else "hinge"), subspace[:3] if slides else subspace[3:]


@dataclass(frozen=True, eq=False)
class Lumped:
    """What formats say of joints.

    Attributes:
        armature, damping, friction: (nv,), of joint and motor together [kg m^2, N m s/rad, N m].
        limit: (nv,) largest torque of the joint's motor [N m], infinite where there is none.
        speed: (nv,) [rad/s].
        unsaid: what these numbers do not hold.
    """

    armature: FloatArray
    damping: FloatArray
    friction: FloatArray
    limit: FloatArray
    speed: FloatArray
    unsaid: tuple[str, ...]

    @classmethod
    def of(cls, robot: Robot, found: JointNumbers, motors: ArrayLike = True) -> Lumped:
        """Return a robot's numbers per joint; of coupled gears only what acts on a joint alone.

        Args:
            robot: with its gears.
            found: its numbers.
            motors: (m,) of whose rotors the numbers stand at the joints; all by default.
        """
        gears, rows = robot.transmission, robot.actuated
        armature = np.zeros(robot.model.nv)
        damping, friction = np.array(found.damping), np.array(found.friction)
        limit, speed = np.full((2, robot.model.nv), np.inf)
        turned = gears.motor_from_joint
        share = turned.T * np.asarray(motors)
        armature[rows] = share**2 @ found.motor_armature
        damping[rows] += share**2 @ found.motor_damping
        friction[rows] += np.abs(share) @ found.motor_friction
        limit[rows], speed[rows] = found.motor_limit, found.motor_speed
        unsaid = list(_drives(robot, found))
        if np.any(turned != np.diag(np.diag(turned))):
            unsaid.insert(
                0,
                "the coupling of the gears (topology): each joint has the diagonal of what the "
                "motors reflect, and its own motor's limits",
            )
        return cls(armature, damping, friction, limit, speed, tuple(unsaid))


def _drives(robot: Robot, found: JointNumbers) -> Iterator[str]:
    for joint in robot.single_joints:
        row = robot.velocity_index(joint)
        stiffness, constant = found.stiffness[row], found.constant[row]
        if stiffness:
            rest = constant / stiffness
            yield f"the spring at {joint} ({stiffness:.6g} N m/rad, slack at {rest:.6g})"
        elif constant:
            yield f"the constant torque at {joint} ({constant:.6g} N m)"
    for joint, gain, offset in zip(
        robot.transmission.joints, found.gain, found.offset, strict=True
    ):
        if gain != 1.0:
            yield (
                f"torque constant of {joint}: the motor gives {gain:.6g} times what is asked for; "
                "multiply the command by it"
            )
        if offset:
            yield f"torque offset of {joint}: {offset:.6g} N m; add it to the command"
    gravity = np.asarray(robot.model.gravity.linear)
    if not np.allclose(gravity, [0.0, 0.0, -9.81], atol=1e-9):
        yield f"gravity {numbers(gravity)} m/s^2"


def number(value: float) -> str:
    """Return a number so that it reads back the same."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them."""
    return " ".join(number(value) for value in values)
