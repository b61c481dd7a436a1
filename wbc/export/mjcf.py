"""MJCF: everything that MuJoCo can be told, coupled gears as tendons."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import LinkEntry, element, links, lumped, numbers, points
from wbc.robot import Robot

_LEAST_MASS, _LEAST_INERTIA = 1e-6, 1e-9  # [kg, kg m^2]; MuJoCo refuses a moving body without
_POINT = 1e-3  # [m] radius of a contact point's sphere


def mjcf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what MJCF cannot say beside what is already unsaid."""
    root = ET.Element("mujoco", model=robot.name)
    element(root, "compiler", angle="radian")
    element(root, "option", gravity=robot.model.gravity.linear)
    serial = _serial(robot)
    joints, unsaid = lumped(robot, found, serial), []
    bodies = {"": element(root, "worldbody")}
    for link in links(robot):
        place, turn = link.placement.translation, _quaternion(link.placement.rotation)
        body = element(bodies[link.parent], "body", name=link.name, pos=place, quat=turn)
        bodies[link.name] = body
        unsaid += [*_joint(body, link, found, joints), *_inertial(body, link)]
    for contact, carrier, place in points(robot):
        rubbing, size = [contact.friction, 0.005, 0.0001], contact.radius or _POINT
        sphere = element(bodies[carrier], "geom", name=contact.name, type="sphere", size=size)
        sphere.attrib |= {"pos": numbers(place), "friction": numbers(rubbing), "mass": "0"}
    _motors(root, robot, found, serial)
    return root, unsaid


def _serial(robot: Robot) -> BoolArray:
    """Return which motors (m,) turn one joint alone: others have their rotors at a tendon."""
    alone = robot.transmission.motor_from_joint != 0.0
    return np.asarray((alone.sum(axis=0) == 1) & (alone.sum(axis=1) == 1) & np.diag(alone))


def _joint(
    body: ET.Element, link: LinkEntry, found: JointNumbers, joints: FloatArray
) -> Iterator[str]:
    if link.kind == "free":
        element(body, "freejoint", name=link.joint)
        return
    row, (low, high) = link.row, link.limits
    bounded = np.isfinite(low) and np.isfinite(high) and high - low < 1e6
    spring, push = found.stiffness[row], found.constant[row]
    names = ("armature", "damping", "frictionloss", "stiffness")
    given = dict(zip(names, (*joints[:, row], spring), strict=True))
    element(
        body,
        "joint",
        name=link.joint,
        type=link.kind,
        axis=link.axis,
        range=[low, high] if bounded else None,
        **{name: value if value > 0.0 else None for name, value in given.items()},
        springref=push / spring if spring > 0.0 else None,
    )
    for name, value in given.items():
        if value < 0.0:
            yield f"the negative {name} of {link.joint} ({value:.3g})"
    if push and spring <= 0.0:
        yield f"the constant torque at {link.joint} ({push:.3g} N m)"


def _inertial(body: ET.Element, link: LinkEntry) -> Iterator[str]:
    """Add mass, centre and inertia about its principal axes; say what had to be changed."""
    moments, axes = np.linalg.eigh(link.inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    if moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-6) + _LEAST_INERTIA:
        yield (
            f"the inertia of {link.name} as it stands: no body has it (one principal moment "
            "exceeds the sum of the others), so its smallest one was raised"
        )
    moments = np.maximum(moments, _LEAST_INERTIA)
    moments[0] = max(moments[0], moments[2] - moments[1])
    mass, center, turn = max(link.inertia.mass, _LEAST_MASS), link.inertia.lever, _quaternion(axes)
    element(body, "inertial", pos=center, quat=turn, mass=mass, diaginertia=moments)


def _motors(root: ET.Element, robot: Robot, found: JointNumbers, serial: BoolArray) -> None:
    """Add one actuator per motor; its control is the torque at the motor's output [N m]."""
    gears = robot.transmission
    if not gears.size:
        return
    tendons = None if serial.all() else element(root, "tendon")
    actuators = element(root, "actuator")
    for k, joint in enumerate(gears.joints):
        limit, turned = found.motor_limit[k], gears.motor_from_joint[k]
        motor = element(
            actuators,
            "general",
            name=joint,
            gainprm=found.gain[k],
            biastype="affine",
            biasprm=[found.offset[k], 0.0, 0.0],
            ctrlrange=[-limit, limit] if np.isfinite(limit) else None,
        )
        if tendons is None or serial[k]:
            motor.set("joint", joint)
            motor.set("gear", numbers([turned[k]]))
            continue
        motor.set("tendon", f"{joint}_motor")
        rotor = {
            "armature": gears.reflected_inertia[k] or None,
            "damping": found.motor_damping[k] or None,
            "frictionloss": found.motor_friction[k] or None,
        }
        tendon = element(tendons, "fixed", name=f"{joint}_motor", **rotor)
        for other in np.flatnonzero(turned):
            element(tendon, "joint", joint=gears.joints[other], coef=turned[other])


def _quaternion(rotation: FloatArray) -> FloatArray:
    return np.asarray(pin.Quaternion(rotation).coeffs())[[3, 0, 1, 2]]
