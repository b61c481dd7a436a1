"""A robot's links, contact points and numbers per joint, as model files want them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import RobotError
from wbc.export.joint_numbers import JointNumbers
from wbc.robot import ContactPoint, Robot
from wbc.robot.coordinates import joint_axis, slides


class LinkEntry(NamedTuple):
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


def links(robot: Robot) -> Iterator[LinkEntry]:
    """Yield the links from the root on, parents first.

    Raises:
        RobotError: a joint that is neither a free base nor has one degree of freedom.
    """
    model, names = robot.model, ["", *robot.bodies]
    for number, joint in enumerate(robot.joints, 1):
        moved = model.joints[number]
        kind, axis, limits = "free", np.zeros(3), (-np.inf, np.inf)
        if moved.nv == 1:
            kind, axis = ("slide" if slides(robot, joint) else "hinge"), joint_axis(robot, joint)
        elif moved.shortname() != "JointModelFreeFlyer":
            raise RobotError(
                f"joint '{joint}' of '{robot.name}' has {moved.nv} degrees of freedom; only a "
                "free base and joints with one can be exported."
            )
        if moved.nq == 1:
            ends = model.lowerPositionLimit, model.upperPositionLimit
            low, high = (float(end[moved.idx_q]) for end in ends)
            limits = (low, high) if low < high else limits
        parent, place = names[model.parents[number]], model.jointPlacements[number]
        inertia, row = model.inertias[number], int(moved.idx_v)
        yield LinkEntry(names[number], joint, parent, place, kind, axis, inertia, limits, row)


def points(robot: Robot) -> Iterator[tuple[ContactPoint, str, FloatArray]]:
    """Yield each contact point with its link ("" for the world) and its place (3,) in it."""
    names = ["", *robot.bodies]
    for contact in robot.contacts:
        joint, place = robot.contact_place(contact)
        yield contact, names[joint], place


def lumped(robot: Robot, found: JointNumbers, motors: ArrayLike = True) -> FloatArray:
    """Return armature, damping and dry friction of joint and motor together, (3, nv).

    In kg m^2, N m s/rad and N m; of coupled gears only what acts on a joint alone.

    Args:
        robot: with its gears.
        found: its numbers.
        motors: (m,) of whose rotors the numbers stand at the joints; all by default.
    """
    at_joints = np.array([np.zeros(robot.model.nv), found.damping, found.friction])
    gears = robot.transmission
    share = np.abs(gears.motor_from_joint.T * np.asarray(motors))
    turning = np.array([gears.reflected_inertia, found.motor_damping])
    at_joints[:2, robot.actuated] += turning @ share.T**2
    at_joints[2, robot.actuated] += share @ found.motor_friction
    return at_joints


def not_lumped(robot: Robot, found: JointNumbers) -> Iterator[str]:
    """Yield what a format that holds numbers of joints alone cannot say of a robot."""
    turned = robot.transmission.motor_from_joint
    if np.any(turned != np.diag(np.diag(turned))):
        yield (
            "the coupling of the gears (topology): each joint has the diagonal of what the motors "
            "reflect, and its own motor's limits"
        )
    for joint in robot.single_joints:
        row = robot.velocity_index(joint)
        stiffness, constant = found.stiffness[row], found.constant[row]
        if stiffness:
            rest = constant / stiffness
            yield f"the spring at {joint} ({stiffness:.6g} N m/rad, slack at {rest:.6g})"
        elif constant:
            yield f"the constant torque at {joint} ({constant:.6g} N m)"
    for k, joint in enumerate(robot.transmission.joints):
        if found.gain[k] != 1.0:
            yield (
                f"torque constant of {joint}: the motor gives {found.gain[k]:.6g} times what is "
                "asked for; multiply the command by it"
            )
        if found.offset[k]:
            yield f"torque offset of {joint}: {found.offset[k]:.6g} N m; add it to the command"
    gravity = np.asarray(robot.model.gravity.linear)
    if not np.allclose(gravity, [0.0, 0.0, -9.81], atol=1e-9):
        yield f"gravity {numbers(gravity)} m/s^2"


def element(parent: ET.Element, tag: str, **attributes: str | ArrayLike | None) -> ET.Element:
    """Add an element to another one; what is None is left out."""
    texts = {
        name: value if isinstance(value, str) else numbers(np.ravel(value))
        for name, value in attributes.items()
        if value is not None
    }
    return ET.SubElement(parent, tag, texts)


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them, so that they read back the same."""
    return " ".join(repr(float(value) + 0.0) for value in values)
