"""MJCF: everything that MuJoCo can be told, coupled gears as tendons."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import LinkEntry, links, number, numbers, points
from wbc.robot import Robot

_LEAST_MASS, _LEAST_INERTIA = 1e-6, 1e-9  # [kg, kg m^2]; MuJoCo refuses a moving body without
_POINT = 1e-3  # [m] radius of a contact point's sphere


def mjcf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what MJCF cannot say beside what is already unsaid."""
    root = ET.Element("mujoco", model=robot.name)
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "option", gravity=numbers(robot.model.gravity.linear))
    world = ET.SubElement(root, "worldbody")
    own = _Shared(robot, found)
    bodies, unsaid = {"": world}, []
    for link in links(robot):
        body = ET.SubElement(
            bodies[link.parent],
            "body",
            name=link.name,
            pos=numbers(link.placement.translation),
            quat=numbers(_quaternion(link.placement.rotation)),
        )
        bodies[link.name] = body
        unsaid += _joint(body, link, found, own)
        unsaid += _inertial(body, link)
    for point in points(robot):
        ET.SubElement(
            bodies[point.link],
            "geom",
            name=point.name,
            type="sphere",
            size=number(point.radius or _POINT),
            pos=numbers(point.position),
            friction=numbers([point.friction, 0.005, 0.0001]),
            mass="0",
        )
    _motors(root, robot, found, own)
    _poses(root, robot)
    return root, unsaid


class _Shared:
    """Which motors turn one joint alone: their numbers stand at the joint, others at a tendon."""

    def __init__(self, robot: Robot, found: JointNumbers) -> None:
        gears = robot.transmission
        self.rows = gears.motor_from_joint  # psi = rows @ q_m
        alone = np.abs(self.rows) > 0.0
        self.serial = (alone.sum(axis=0) == 1) & (alone.sum(axis=1) == 1) & np.diag(alone)
        self.armature, self.damping, self.friction = np.zeros((3, robot.model.nv))
        scale = np.diag(self.rows)
        for k in np.flatnonzero(self.serial):
            row = robot.actuated[k]
            self.armature[row] = scale[k] ** 2 * found.motor_armature[k]
            self.damping[row] = scale[k] ** 2 * found.motor_damping[k]
            self.friction[row] = abs(scale[k]) * found.motor_friction[k]


def _joint(body: ET.Element, link: LinkEntry, found: JointNumbers, own: _Shared) -> list[str]:
    if link.kind == "free":
        ET.SubElement(body, "freejoint", name=link.joint)
        return []
    row, unsaid = link.row, []
    joint = ET.SubElement(body, "joint", name=link.joint, type=link.kind, axis=numbers(link.axis))
    low, high = link.limits
    if np.isfinite(low) and np.isfinite(high) and high - low < 1e6:
        joint.set("range", numbers([low, high]))
    given = {
        "armature": own.armature[row],
        "damping": found.damping[row] + own.damping[row],
        "frictionloss": found.friction[row] + own.friction[row],
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


def _motors(root: ET.Element, robot: Robot, found: JointNumbers, own: _Shared) -> None:
    """Add one actuator per motor; its control is the torque at the motor's output [N m]."""
    gears = robot.transmission
    if not gears.size:
        return
    tendons = None if own.serial.all() else ET.SubElement(root, "tendon")
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
        if own.serial[k] or tendons is None:
            motor.set("joint", joint)
            motor.set("gear", number(float(own.rows[k, k])))
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
        for other, coefficient in zip(gears.joints, own.rows[k], strict=True):
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
