"""URDF: links, damping, dry friction and limits; the rest is said in words."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import LinkEntry, element, links, lumped, not_lumped, points
from wbc.robot import Robot

_WORLD = "world"
_UNLIMITED = 1e9  # URDF wants a number where there is no limit


def urdf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what URDF cannot say beside what is already unsaid."""
    root = ET.Element("robot", name=robot.name)
    at_joints, unsaid = lumped(robot, found), list(not_lumped(robot, found))
    for moved in robot.single_joints:
        if armature := at_joints[0, robot.velocity_index(moved)]:
            text = f"armature of {moved}: {armature:.6g} kg m^2; set it in the simulator"
            unsaid.append(f"{text} after loading")
    gears = robot.transmission
    pairs = zip(found.motor_limit, gears.speed_limit / np.abs(gears.gear_ratio), strict=True)
    limits = dict(zip(gears.joints, pairs, strict=True))
    entries = list(links(robot))
    if not (entries and entries[0].kind == "free"):
        element(root, "link", name=_WORLD)
    for link in entries:
        _link(root, link.name, link.inertia)
        if link.kind != "free":
            _joint(root, link, at_joints[1:, link.row], limits.get(link.joint, (np.inf, np.inf)))
    taken = {link.name for link in entries}
    for contact, carrier, place in points(robot):
        name = contact.name if contact.name not in taken else f"{contact.name}_contact"
        point = element(root, "link", name=name)
        if contact.radius > 0.0:
            shape = element(element(point, "collision"), "geometry")
            element(shape, "sphere", radius=contact.radius)
        joint = element(root, "joint", name=f"{name}_fixed", type="fixed")
        _between(joint, carrier, name)
        element(joint, "origin", xyz=place, rpy="0 0 0")
    return root, unsaid


def _between(joint: ET.Element, parent: str, child: str) -> None:
    element(joint, "parent", link=parent or _WORLD)
    element(joint, "child", link=child)


def _link(root: ET.Element, name: str, inertia: pin.Inertia) -> None:
    link = element(root, "link", name=name)
    if inertia.mass > 0.0:
        entry = element(link, "inertial")
        element(entry, "origin", xyz=inertia.lever, rpy="0 0 0")
        element(entry, "mass", value=inertia.mass)
        pairs = [(i, j) for i in range(3) for j in range(i, 3)]
        upper = {f"i{'xyz'[i]}{'xyz'[j]}": inertia.inertia[i, j] for i, j in pairs}
        element(entry, "inertia", **upper)


def _joint(
    root: ET.Element, link: LinkEntry, resistance: FloatArray, limits: tuple[float, float]
) -> None:
    """Add a joint with its damping and dry friction (2,), and its motor's torque and speed."""
    low, high = np.clip(link.limits, -_UNLIMITED, _UNLIMITED)
    bounded = bool(np.isfinite(link.limits).all() and high - low < _UNLIMITED)
    kind = "prismatic" if link.kind == "slide" else "revolute" if bounded else "continuous"
    joint = element(root, "joint", name=link.joint, type=kind)
    _between(joint, link.parent, link.name)
    turn = pin.rpy.matrixToRpy(link.placement.rotation)
    element(joint, "origin", xyz=link.placement.translation, rpy=turn)
    element(joint, "axis", xyz=link.axis)
    ends = {} if kind == "continuous" else {"lower": low, "upper": high}
    effort, velocity = np.minimum(limits, _UNLIMITED)
    element(joint, "limit", effort=effort, velocity=velocity, **ends)
    if resistance.any():
        element(joint, "dynamics", damping=resistance[0], friction=resistance[1])
