"""One robot, one file: MJCF, with or without its losses, and what MJCF cannot say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from pprint import pformat
from textwrap import wrap
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import RobotError, require_known
from wbc.export.numbers import TOLD, JointNumbers, loss_numbers
from wbc.files import as_json, write_text
from wbc.robot import Robot
from wbc.robot.coordinates import joint_axis, slides

FORMATS = ("mujoco", "mjcf")
"""With the losses of the gears, and without them."""
_LEAST_MASS, _LEAST_INERTIA = 1e-6, 1e-9  # [kg, kg m^2]; MuJoCo refuses a moving body without
_POINT = 1e-3  # [m] radius of a contact point's sphere
_ENDLESS = 1e6  # [rad, m] range from which on a joint has no ends


@dataclass(frozen=True)
class Exported:
    """A robot in the format of another simulator.

    Attributes:
        text: of the file.
        unsaid: sentences on what the format cannot say; they stand in a comment of the file, too.
        notes: delays of the drives, which the user sets.
        losses: text of the Python file with the gears' losses, None for formats without it.
    """

    text: str
    unsaid: tuple[str, ...]
    notes: tuple[str, ...]
    losses: str | None = None

    def write(self, path: str | Path) -> Path:
        """Write the file, whole or not at all, and its losses as NAME_losses.py beside it."""
        if self.losses is not None:
            write_text(losses_path(path), self.losses)
        return write_text(path, self.text)


def losses_path(path: str | Path) -> Path:
    """Return where the losses of an exported file stand: a.xml has a_losses.py beside it."""
    return Path(path).with_name(f"{Path(path).stem}_losses.py")


def export_robot(robot: Robot, to: str) -> Exported:
    """Return a robot with its effects in the format of a simulator.

    Links, joints, contact points, rotor inertia, friction, springs and limits are written as far
    as the format holds them. Shapes and pictures are not.

    Args:
        to: `mjcf`, or `mujoco` for MJCF and a Python file with the losses (`wbc.export.losses`).

    Raises:
        RobotError: another format, a joint of a kind that is not exported, or a self-locking gear
            for `mujoco`.
    """
    require_known(RobotError, "format", to, FORMATS)
    losses = loss_module(robot) if to == "mujoco" else None
    found = JointNumbers(robot, () if losses is None else TOLD)
    content, more = mjcf(robot, found)
    unsaid = tuple(dict.fromkeys([*found.unsaid, *more]))
    notes = tuple(
        f"actuator delay of {joint}: {delay:.6g} s; give it to your simulator's actuator model"
        for joint, delay in zip(robot.transmission.joints, found.delay, strict=True)
        if delay
    )
    lines = [f"{robot.name}, written by wbc export. Shapes and pictures are not in it."]
    if losses is not None:
        lines.append("The losses of its gears act if the Python file beside it is called.")
    for title, texts in (("Set by hand:", notes), ("This format cannot say:", unsaid)):
        lines += [title] if texts else []
        for said in texts:
            lines += wrap(said, 96, initial_indent="  - ", subsequent_indent="    ")
    comment = "\n".join(lines).replace("--", "- -")  # two hyphens end a comment in XML
    ET.indent(content)
    text = f"<!--\n{comment}\n-->\n{ET.tostring(content, encoding='unicode')}\n"
    return Exported(text, unsaid, notes, losses)


def loss_module(robot: Robot) -> str:
    """Return the text of a Python file with a robot's losses, which needs NumPy only.

    Raises:
        RobotError: a gear with losses is self-locking.
    """
    table = pformat(as_json(loss_numbers(robot)), width=100, sort_dicts=False)
    code = Path(__file__).with_name("losses.py").read_text(encoding="utf-8")
    function = (
        "def losses(model: Any) -> Losses:\n"
        '    """Return the losses of this robot in a model of MuJoCo."""\n'
        "    return Losses(model, NUMBERS)\n"
    )
    named = "NUMBERS: Numbers = " + table + f'\n"""Losses of {robot.name}."""'
    return "\n\n".join((code, named + "\n", function))


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


def mjcf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what MJCF cannot say beside what is already unsaid.

    Raises:
        RobotError: a joint that is neither a free base nor has one degree of freedom.
    """
    model, gears, names = robot.model, robot.transmission, robot.bodies
    root = ET.Element("mujoco", model=robot.name)
    element(root, "compiler", angle="radian")
    element(root, "option", gravity=model.gravity.linear)
    # A motor that turns one joint alone has its rotor there, any other at a tendon.
    alone = gears.motor_from_joint != 0.0
    serial = (alone.sum(axis=0) == 1) & (alone.sum(axis=1) == 1) & np.diag(alone)
    share = np.abs(np.diag(gears.motor_from_joint)) * serial
    armature, damping, friction = np.zeros(model.nv), found.damping.copy(), found.friction.copy()
    armature[robot.actuated] = share**2 * gears.reflected_inertia
    damping[robot.actuated] += share**2 * found.motor_damping
    friction[robot.actuated] += share * found.motor_friction
    given = {"armature": armature, "damping": damping, "frictionloss": friction}
    given |= {"stiffness": found.stiffness, "constant": found.constant}
    bodies, unsaid = [element(root, "worldbody")], list[str]()
    for number, (joint, link) in enumerate(zip(robot.joints, names, strict=True), 1):
        place = model.jointPlacements[number]
        at = {"pos": place.translation, "quat": _quaternion(place.rotation)}
        bodies.append(element(bodies[model.parents[number]], "body", name=link, **at))
        unsaid += _joint(bodies[-1], robot, joint, given)
        unsaid += _inertial(bodies[-1], link, model.inertias[number])
    for contact in robot.contacts:
        carrier, place = robot.contact_place(contact)
        rubbing, size = [contact.friction, 0.005, 0.0001], contact.radius or _POINT
        sphere = element(bodies[carrier], "geom", name=contact.name, type="sphere", size=size)
        sphere.attrib |= {"pos": numbers(place), "friction": numbers(rubbing), "mass": "0"}
    _motors(root, robot, found, serial)
    return root, unsaid


def _joint(
    body: ET.Element, robot: Robot, joint: str, given: Mapping[str, FloatArray]
) -> Iterator[str]:
    """Add a joint with what is given of it (nv,); say what it cannot hold.

    Raises:
        RobotError: a joint that is neither a free base nor has one degree of freedom.
    """
    model = robot.model
    moved = model.joints[model.getJointId(joint)]
    if moved.shortname() == "JointModelFreeFlyer":
        element(body, "freejoint", name=joint)
        return
    if moved.nv != 1:
        has = f"has {moved.nv} degrees of freedom"
        why = "only a free base and joints with one can be exported."
        raise RobotError(f"joint '{joint}' of '{robot.name}' {has}; {why}")
    low, high = (end[moved.idx_q] for end in (model.lowerPositionLimit, model.upperPositionLimit))
    row, bounded = moved.idx_v, moved.nq == 1 and 0.0 < high - low < _ENDLESS
    own = {name: float(values[row]) for name, values in given.items()}
    spring, push = own["stiffness"], own.pop("constant")
    element(
        body,
        "joint",
        name=joint,
        type="slide" if slides(robot, joint) else "hinge",
        axis=joint_axis(robot, joint),
        range=[low, high] if bounded else None,
        **{name: value if value > 0.0 else None for name, value in own.items()},
        springref=push / spring if spring > 0.0 else None,
    )
    for name, value in own.items():
        if value < 0.0:
            yield f"the negative {name} of {joint} ({value:.3g})"
    if push and spring <= 0.0:
        yield f"the constant torque at {joint} ({push:.3g} N m)"


def _inertial(body: ET.Element, link: str, inertia: pin.Inertia) -> Iterator[str]:
    """Add mass, centre and inertia about its principal axes; say what had to be changed."""
    moments, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    if moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-6) + _LEAST_INERTIA:
        why = "no body has it (one principal moment exceeds the sum of the others)"
        yield f"the inertia of {link} as it stands: {why}, so its smallest one was raised"
    moments = np.maximum(moments, _LEAST_INERTIA)
    moments[0] = max(moments[0], moments[2] - moments[1])
    mass, turn = max(inertia.mass, _LEAST_MASS), _quaternion(axes)
    element(body, "inertial", pos=inertia.lever, quat=turn, mass=mass, diaginertia=moments)


def _motors(root: ET.Element, robot: Robot, found: JointNumbers, serial: BoolArray) -> None:
    """Add one actuator per motor; its control is the torque at the motor's output [N m]."""
    gears = robot.transmission
    if not gears.size:
        return
    tendons = None if serial.all() else element(root, "tendon")
    actuators = element(root, "actuator")
    for k, joint in enumerate(gears.joints):
        limit, turned = found.motor_limit[k], gears.motor_from_joint[k]
        alone = tendons is None or serial[k]
        element(
            actuators,
            "general",
            name=joint,
            gainprm=found.gain[k],
            biastype="affine",
            biasprm=[found.offset[k], 0.0, 0.0],
            ctrlrange=[-limit, limit] if np.isfinite(limit) else None,
            **{"joint": joint, "gear": turned[k]} if alone else {"tendon": f"{joint}_motor"},
        )
        if tendons is None or alone:
            continue
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
