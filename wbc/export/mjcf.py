"""MJCF: everything that MuJoCo can be told, coupled gears as tendons."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import LinkEntry, Lumped, links, number, numbers, points
from wbc.robot import Robot

_LEAST_MASS, _LEAST_INERTIA = 1e-6, 1e-9  # [kg, kg m^2]; MuJoCo refuses a moving body without
_POINT = 1e-3  # [m] radius of a contact point's sphere


def mjcf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what MJCF cannot say beside what is already unsaid."""
    root = ET.Element("mujoco", model=robot.name)
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "option", gravity=numbers(robot.model.gravity.linear))
    world = ET.SubElement(root, "worldbody")
    serial = _serial(robot)
    joints, bodies, unsaid = Lumped.of(robot, found, serial), {"": world}, []
    for link in links(robot):
        body = ET.SubElement(
            bodies[link.parent],
            "body",
            name=link.name,
            pos=numbers(link.placement.translation),
            quat=numbers(_quaternion(link.placement.rotation)),
        )
        bodies[link.name] = body
        unsaid += _joint(body, link, found, joints)
        unsaid += _inertial(body, link)
    for contact, carrier, place in points(robot):
        ET.SubElement(
            bodies[carrier],
            "geom",
            name=contact.name,
            type="sphere",
            size=number(contact.radius or _POINT),
            pos=numbers(place),
            friction=numbers([contact.friction, 0.005, 0.0001]),
            mass="0",
        )
    _motors(root, robot, found, serial)
    _poses(root, robot)
    return root, unsaid


def _serial(robot: Robot) -> BoolArray:
    """Return which motors (m,) turn one joint alone: others have their rotors at a tendon."""
    alone = robot.transmission.motor_from_joint != 0.0
    return np.asarray((alone.sum(axis=0) == 1) & (alone.sum(axis=1) == 1) & np.diag(alone))


def _joint(body: ET.Element, link: LinkEntry, found: JointNumbers, joints: Lumped) -> list[str]:
    if link.kind == "free":
        ET.SubElement(body, "freejoint", name=link.joint)
        return []
    row, unsaid = link.row, []
    joint = ET.SubElement(body, "joint", name=link.joint, type=link.kind, axis=numbers(link.axis))
    low, high = link.limits
    if np.isfinite(low) and np.isfinite(high) and high - low < 1e6:
        joint.set("range", numbers([low, high]))
    given = {
        "armature": joints.armature[row],
        "damping": joints.damping[row],
        "frictionloss": joints.friction[row],
        "stiffness": found.stiffness[row],
    }
    for name, value in given.items():
        if value > 0.0:
            joint.set(name, number(value))
        elif value < 0.0:
            unsaid.append(f"the negative {name} of {link.joint} ({value:.3g})")
    if found.stiffness[row] > 0.0:
        joint.set("springref", number(found.constant[row] / found.stiffness[row]))
    elif found.constant[row]:
        unsaid.append(f"the constant torque at {link.joint} ({found.constant[row]:.3g} N m)")
    return unsaid


def _inertial(body: ET.Element, link: LinkEntry) -> list[str]:
    """Add mass, centre and inertia about its principal axes; say what had to be changed."""
    moments, axes = np.linalg.eigh(link.inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    unsaid = []
    if moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-6) + _LEAST_INERTIA:
        unsaid.append(
            f"the inertia of {link.name} as it stands: no body has it (one principal moment "
            "exceeds the sum of the others), so its smallest one was raised"
        )
    moments = np.maximum(moments, _LEAST_INERTIA)
    moments[0] = max(moments[0], moments[2] - moments[1])
    ET.SubElement(
        body,
        "inertial",
        pos=numbers(link.inertia.lever),
        quat=numbers(_quaternion(axes)),
        mass=number(max(link.inertia.mass, _LEAST_MASS)),
        diaginertia=numbers(moments),
    )
    return unsaid


def _motors(root: ET.Element, robot: Robot, found: JointNumbers, serial: BoolArray) -> None:
    """Add one actuator per motor; its control is the torque at the motor's output [N m]."""
    gears = robot.transmission
    if not gears.size:
        return
    tendons = None if serial.all() else ET.SubElement(root, "tendon")
    actuators = ET.SubElement(root, "actuator")
    for k, joint in enumerate(gears.joints):
        motor = ET.SubElement(
            actuators,
            "general",
            name=joint,
            gainprm=number(found.gain[k]),
            biastype="affine",
            biasprm=numbers([found.offset[k], 0.0, 0.0]),
        )
        if np.isfinite(found.motor_limit[k]):
            motor.set("ctrlrange", numbers([-found.motor_limit[k], found.motor_limit[k]]))
        if serial[k] or tendons is None:
            motor.set("joint", joint)
            motor.set("gear", number(float(gears.motor_from_joint[k, k])))
            continue
        motor.set("tendon", f"{joint}_motor")
        tendon = ET.SubElement(tendons, "fixed", name=f"{joint}_motor")
        for name, value in (
            ("armature", found.motor_armature[k]),
            ("damping", found.motor_damping[k]),
            ("frictionloss", found.motor_friction[k]),
        ):
            if value > 0.0:
                tendon.set(name, number(value))
        for other, coefficient in zip(gears.joints, gears.motor_from_joint[k], strict=True):
            if coefficient:
                ET.SubElement(tendon, "joint", joint=other, coef=number(coefficient))


def _poses(root: ET.Element, robot: Robot) -> None:
    if not robot.poses or robot.model.nq != robot.model.nv + int(robot.has_free_flyer):
        return
    keys = ET.SubElement(root, "keyframe")
    for name, q in robot.poses.items():
        position = np.array(q)
        if robot.has_free_flyer:
            position[3:7] = position[[6, 3, 4, 5]]
        ET.SubElement(keys, "key", name=name, qpos=numbers(position))


def _quaternion(rotation: FloatArray) -> FloatArray:
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return np.array([w, x, y, z])
