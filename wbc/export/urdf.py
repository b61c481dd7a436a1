"""URDF: links, damping, dry friction and limits; the rest is said in words."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import LinkEntry, Lumped, links, number, numbers, points
from wbc.robot import Robot

_WORLD = "world"
_UNLIMITED = 1e9  # URDF wants a number where there is no limit


def urdf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what URDF cannot say beside what is already unsaid."""
    root = ET.Element("robot", name=robot.name)
    at_joints = Lumped.of(robot, found)
    unsaid = list(at_joints.unsaid)
    for moved in robot.single_joints:
        armature = at_joints.armature[robot.velocity_index(moved)]
        if armature:
            text = f"armature of {moved}: {armature:.6g} kg m^2; set it in the simulator"
            unsaid.append(f"{text} after loading")
    entries = links(robot)
    floats = bool(entries) and entries[0].kind == "free"
    if not floats:
        ET.SubElement(root, "link", name=_WORLD)
    for link in entries:
        _link(root, link.name, link.inertia)
        if link.kind != "free":
            _joint(root, link, at_joints)
    taken = {link.name for link in entries}
    for contact, carrier, place in points(robot):
        name = contact.name if contact.name not in taken else f"{contact.name}_contact"
        ET.SubElement(root, "link", name=name)
        joint = ET.SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        ET.SubElement(joint, "parent", link=carrier or _WORLD)
        ET.SubElement(joint, "child", link=name)
        ET.SubElement(joint, "origin", xyz=numbers(place), rpy="0 0 0")
    return root, unsaid


def _link(root: ET.Element, name: str, inertia: pin.Inertia) -> None:
    link = ET.SubElement(root, "link", name=name)
    if inertia.mass <= 0.0:
        return
    entry = ET.SubElement(link, "inertial")
    ET.SubElement(entry, "origin", xyz=numbers(inertia.lever), rpy="0 0 0")
    ET.SubElement(entry, "mass", value=number(inertia.mass))
    matrix, axes = inertia.inertia, "xyz"
    entries = {f"i{axes[i]}{axes[j]}": number(matrix[i, j]) for i in range(3) for j in range(i, 3)}
    ET.SubElement(entry, "inertia", entries)


def _joint(root: ET.Element, link: LinkEntry, at_joints: Lumped) -> None:
    low, high = link.limits
    bounded = bool(np.isfinite(low) and np.isfinite(high) and high - low < _UNLIMITED)
    kind = "prismatic" if link.kind == "slide" else "revolute" if bounded else "continuous"
    joint = ET.SubElement(root, "joint", name=link.joint, type=kind)
    ET.SubElement(joint, "parent", link=link.parent or _WORLD)
    ET.SubElement(joint, "child", link=link.name)
    turn = pin.rpy.matrixToRpy(link.placement.rotation)
    ET.SubElement(joint, "origin", xyz=numbers(link.placement.translation), rpy=numbers(turn))
    ET.SubElement(joint, "axis", xyz=numbers(link.axis))
    effort, speed = at_joints.limit[link.row], at_joints.speed[link.row]
    limit = {"effort": min(effort, _UNLIMITED), "velocity": min(speed, _UNLIMITED)}
    if kind != "continuous":
        limit["lower"], limit["upper"] = np.clip([low, high], -_UNLIMITED, _UNLIMITED)
    ET.SubElement(joint, "limit", {name: number(value) for name, value in limit.items()})
    damping, friction = at_joints.damping[link.row], at_joints.friction[link.row]
    if damping or friction:
        ET.SubElement(joint, "dynamics", damping=number(damping), friction=number(friction))
