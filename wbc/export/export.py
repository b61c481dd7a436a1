"""One robot, one file: MJCF, URDF, or MJCF with losses, and what the format cannot say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from pprint import pformat
from textwrap import wrap
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import RobotError, require_known
from wbc.export.numbers import TOLD, JointNumbers, joint_numbers, loss_numbers
from wbc.files import as_json, write_text
from wbc.robot import ContactPoint, Robot
from wbc.robot.coordinates import joint_axis, slides

FORMATS = {"mujoco": ".xml", "mjcf": ".xml", "urdf": ".urdf"}
"""Format -> ending of its file."""
_LEAST_MASS, _LEAST_INERTIA = 1e-6, 1e-9  # [kg, kg m^2]; MuJoCo refuses a moving body without
_POINT = 1e-3  # [m] radius of a contact point's sphere
_WORLD = "world"  # link of a URDF
_UNLIMITED = 1e9  # URDF wants a number where there is no limit


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
        robot: with its effects.
        to: `mjcf`, `urdf`, or `mujoco` for MJCF and a Python file with the losses
            (`wbc.export.losses`).

    Raises:
        RobotError: another format, a joint of a kind that is not exported, or a self-locking gear
            for `mujoco`.
    """
    require_known(RobotError, "format", to, FORMATS)
    losses = loss_module(robot) if to == "mujoco" else None
    found = joint_numbers(robot, () if losses is None else TOLD)
    content, more = (urdf if to == "urdf" else mjcf)(robot, found)
    unsaid = tuple(dict.fromkeys([*found.unsaid, *more]))
    notes = tuple(
        f"actuator delay of {joint}: {delay:.6g} s; give it to your simulator's actuator model"
        for joint, delay in zip(robot.transmission.joints, found.delay, strict=True)
        if delay
    )
    # Two hyphens end a comment in XML.
    comment = _comment(robot, unsaid, notes, losses is not None).replace("--", "- -")
    ET.indent(content)
    text = f"<!--\n{comment}\n-->\n{ET.tostring(content, encoding='unicode')}\n"
    return Exported(text, unsaid, notes, losses)


def _comment(
    robot: Robot, unsaid: tuple[str, ...], notes: tuple[str, ...], with_losses: bool
) -> str:
    lines = [f"{robot.name}, written by wbc export. Shapes and pictures are not in it."]
    if with_losses:
        lines.append("The losses of its gears act if the Python file beside it is called.")
    for title, texts in (("Set by hand:", notes), ("This format cannot say:", unsaid)):
        if texts:
            lines.append(title)
        for text in texts:
            lines += wrap(text, 96, initial_indent="  - ", subsequent_indent="    ")
    return "\n".join(lines)


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


def mjcf(robot: Robot, found: JointNumbers) -> tuple[ET.Element, list[str]]:
    """Return the model, and what MJCF cannot say beside what is already unsaid."""
    root = ET.Element("mujoco", model=robot.name)
    element(root, "compiler", angle="radian")
    element(root, "option", gravity=robot.model.gravity.linear)
    # A motor that turns one joint alone has its rotor there, any other at a tendon.
    alone = robot.transmission.motor_from_joint != 0.0
    serial = (alone.sum(axis=0) == 1) & (alone.sum(axis=1) == 1) & np.diag(alone)
    joints, unsaid = lumped(robot, found, serial), []
    bodies = {"": element(root, "worldbody")}
    for link in links(robot):
        place, turn = link.placement.translation, _quaternion(link.placement.rotation)
        body = element(bodies[link.parent], "body", name=link.name, pos=place, quat=turn)
        bodies[link.name] = body
        unsaid += [*_mjcf_joint(body, link, found, joints), *_inertial(body, link)]
    for contact, carrier, place in points(robot):
        rubbing, size = [contact.friction, 0.005, 0.0001], contact.radius or _POINT
        sphere = element(bodies[carrier], "geom", name=contact.name, type="sphere", size=size)
        sphere.attrib |= {"pos": numbers(place), "friction": numbers(rubbing), "mass": "0"}
    _motors(root, robot, found, serial)
    return root, unsaid


def _mjcf_joint(
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
        _urdf_link(root, link.name, link.inertia)
        if link.kind != "free":
            _urdf_joint(
                root, link, at_joints[1:, link.row], limits.get(link.joint, (np.inf, np.inf))
            )
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


def _urdf_link(root: ET.Element, name: str, inertia: pin.Inertia) -> None:
    link = element(root, "link", name=name)
    if inertia.mass > 0.0:
        entry = element(link, "inertial")
        element(entry, "origin", xyz=inertia.lever, rpy="0 0 0")
        element(entry, "mass", value=inertia.mass)
        pairs = [(i, j) for i in range(3) for j in range(i, 3)]
        upper = {f"i{'xyz'[i]}{'xyz'[j]}": inertia.inertia[i, j] for i, j in pairs}
        element(entry, "inertia", **upper)


def _urdf_joint(
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
