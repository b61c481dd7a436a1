"""The links of a robot as model files want them: one per joint, place, axis and inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import RobotError
from wbc.robot import Robot

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


@dataclass(frozen=True, eq=False)
class PointEntry:
    """A contact point: its name, link ("" for the world), place in the link, friction, radius."""

    name: str
    link: str
    position: FloatArray
    friction: float
    radius: float


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


def points(robot: Robot) -> list[PointEntry]:
    """Return the contact points in the frames of their links."""
    model, names = robot.model, ["", *robot.bodies]
    found = []
    for contact in robot.contacts:
        frame = model.frames[model.getFrameId(contact.frame)]
        place = (frame.placement * contact.placement()).translation
        link = names[frame.parentJoint]
        found.append(PointEntry(contact.name, link, place, contact.friction, contact.radius))
    return found


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
