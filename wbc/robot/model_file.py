"""Loading the rigid bodies from URDF or MJCF, and saying what of the file was not used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from wbc.errors import RobotError, require_known
from wbc.robot.robot import bodies_of

_BASES = ("fixed", "free_flyer")
_ENDLESS = 1e9  # limits where there are none, while a file is parsed that must state numbers


def read_model(path: Path, base: str, lock: Sequence[str]) -> tuple[pin.Model, tuple[str, ...]]:
    """Return the links of a model file and notes on what was read but set aside.

    Args:
        path: a `.urdf` or MJCF `.xml` file.
        base: "fixed" (the file's root is the world; a free joint of it is removed) or "free_flyer"
            (a free-flyer is put first); empty to take the base as the file has it.
        lock: joints to weld at their neutral position.

    Raises:
        RobotError: an unreadable file, an unknown base or joint, or an impossible inertia.
    """
    if base:
        require_known(RobotError, "base", base, _BASES, f"{path}")
    model = _parse(path, base)
    notes = (*_set_aside(model, path), *check_inertias(model, path))
    if base == "fixed" and _floats(model):
        # A file whose robot is free describes one that is held, too: without the free joint.
        notes = (*notes, f"{path.name}: its free joint was removed, since the base is fixed.")
        model = pin.buildReducedModel(model, [1], pin.neutral(model))
    if lock:
        known = list(model.names)[1:]
        for joint in lock:
            require_known(RobotError, "joint", joint, known, f"{path}: lock")
        numbers = [model.getJointId(joint) for joint in lock]
        model = pin.buildReducedModel(model, numbers, pin.neutral(model))
    # Parser and reduction store the speed limit with the same sign on both sides.
    model.lowerVelocityLimit = -np.abs(model.upperVelocityLimit)
    return model, notes


def driven_joints(model: pin.Model) -> tuple[str, ...]:
    """Return the joints of a model that a gear can drive: those with one degree of freedom."""
    pairs = list(zip(model.names, model.joints, strict=True))[1:]
    return tuple(name for name, joint in pairs if joint.nv == 1 and joint.nq == 1)


def _parse(path: Path, base: str) -> pin.Model:
    try:
        if path.suffix == ".urdf":
            return _parse_urdf(path, base)
        if path.suffix == ".xml":
            model = pin.buildModelFromMJCF(str(path))
            if base == "free_flyer" and not _floats(model):
                return pin.buildModelFromMJCFAndRootJoint(str(path), pin.JointModelFreeFlyer())
            return model
    except (ValueError, RuntimeError, ET.ParseError) as cause:
        raise RobotError(f"cannot read the model file '{path}': {cause}.") from cause
    raise RobotError(f"'{path}': a model file ends in .urdf or .xml (MJCF).")


def _parse_urdf(path: Path, base: str) -> pin.Model:
    """Return the links of a URDF; a continuous joint is a revolute one without ends.

    pinocchio's own continuous joint has the coordinates (cos q, sin q), which forget the turns
    that encoders count and are no position of a log.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    robot = ET.fromstring(text)
    turning = [joint for joint in robot.findall("joint") if joint.get("type") == "continuous"]
    for joint in turning:
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = ET.SubElement(joint, "limit", effort=f"{_ENDLESS:g}", velocity=f"{_ENDLESS:g}")
        limit.set("lower", f"{-_ENDLESS:g}")
        limit.set("upper", f"{_ENDLESS:g}")
    text = ET.tostring(robot, encoding="unicode") if turning else text
    root = (pin.JointModelFreeFlyer(),) if base == "free_flyer" else ()
    model = pin.buildModelFromXML(text, *root)
    low, high = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    model.lowerPositionLimit = np.where(low == -_ENDLESS, -np.inf, low)
    model.upperPositionLimit = np.where(high == _ENDLESS, np.inf, high)
    return model


def _floats(model: pin.Model) -> bool:
    return bool(model.njoints > 1 and model.joints[1].shortname() == "JointModelFreeFlyer")


def _set_aside(model: pin.Model, path: Path) -> tuple[str, ...]:
    """Zero what the transmission and the effects are responsible for; say which values it held."""
    notes = []
    for label, values in (
        ("armature", model.armature),
        ("rotorInertia", model.rotorInertia),
        ("damping", model.damping),
        ("friction", model.upperDryFrictionLimit),
    ):
        held = np.array(values)
        if np.any(held != 0.0):
            rows = ", ".join(f"{held[i]:g}" for i in np.flatnonzero(held))
            notes.append(
                f"{path.name}: {label} ({rows}) was read and set aside; give it in robot.toml "
                "(rotor_inertia) or as an effect (viscous_friction, coulomb_friction)."
            )
    for name in ("armature", "damping", "upperDryFrictionLimit", "lowerDryFrictionLimit"):
        setattr(model, name, np.zeros(model.nv))
    tag = "transmission" if path.suffix == ".urdf" else "actuator"
    if xml_root(path).find(f".//{tag}") is not None:
        notes.append(f"{path.name}: <{tag}> was ignored; gears stand in robot.toml.")
    return (*notes, *left_out(path))


def xml_root(path: Path) -> ET.Element:
    """Return the root of a file, an empty one of a file that is no XML."""
    try:
        return ET.parse(path).getroot()
    except ET.ParseError:
        return ET.Element("none")


_LOOPS = ("connect", "weld")


def left_out(path: Path) -> tuple[str, ...]:
    """Return notes on the parts of a URDF or MJCF file that the model does not keep.

    Args:
        path: a `.urdf` or MJCF `.xml` file that could be read; parts that an MJCF includes from
            other files are not looked at.
    """
    root = xml_root(path)
    found = _of_urdf(root) if path.suffix == ".urdf" else _of_mjcf(root)
    return tuple(f"{path.name}: {text}" for text in found)


def closed_loops(path: Path) -> tuple[str, ...]:
    """Return the loops that an MJCF file closes, by what closes them and the bodies or sites."""
    if path.suffix != ".xml":
        return ()
    items = xml_root(path).iterfind(".//equality/*")
    return tuple(f"{item.tag} of {_between(item)}" for item in items if item.tag in _LOOPS)


def _between(item: ET.Element) -> str:
    """Return what an equality of an MJCF file stands between."""
    keys = ("body1", "body2", "joint1", "joint2", "site1", "site2")
    ends = [end for end in map(item.get, keys) if end]
    return " and ".join(ends) or item.get("name", "")


def _of_urdf(root: ET.Element) -> list[str]:
    return [
        f"joint '{joint.get('name')}' mimics '{mimic.get('joint')}' in the file; here it moves by "
        "itself. If one motor drives both, lock it (lock) or leave it without a gear; a coupling "
        "of driven joints is the topology of [transmission]."
        for joint in root.iter("joint")
        for mimic in joint.findall("mimic")
    ]


def _of_mjcf(root: ET.Element) -> list[str]:
    notes = []
    for item in root.iterfind(".//equality/*"):
        kind = "closes a loop" if item.tag in _LOOPS else "couples joints"
        notes.append(
            f"equality '{item.tag}' of {_between(item)} {kind} and was left out: links form a "
            "tree here. A parallelogram or belt is the topology of [transmission]."
        )
    for name, meaning in (
        ("stiffness", "add a joint_spring"),
        ("springref", "the rest angle of a joint_spring"),
    ):
        held = [
            f"{joint.get('name', 'of a default class')} {joint.get(name)}"
            for joint in root.iter("joint")
            if any(float(x) != 0.0 for x in joint.get(name, "").split())
        ]
        if held:
            notes.append(f"{name} ({', '.join(held)}) was left out; {meaning}.")
    ranges = [
        f"{motor.get('joint', motor.get('name', motor.tag))} [{motor.get('ctrlrange')}]"
        for motor in root.iterfind(".//actuator/*[@ctrlrange]")
    ]
    if ranges:
        notes.append(
            f"ctrlrange ({', '.join(ranges)}) was left out; give torque_limit in robot.toml."
        )
    keys = [key.get("name", "without a name") for key in root.iterfind(".//keyframe/*")]
    if keys:
        notes.append(f"keyframes ({', '.join(keys)}) were left out; give them as [poses].")
    return notes


_PRINTED = 1e-6  # of the largest principal value: digits of a printed matrix


def check_inertias(model: pin.Model, path: Path) -> tuple[str, ...]:
    """Check the inertias about the centres of mass of what moves: links, with those fixed to them.

    Args:
        model: of the links.
        path: its file, for messages.

    Returns:
        Notes on links whose largest principal value is more than the sum of the others, which no
        distribution of mass has, though a controller can live with it.

    Raises:
        RobotError: an inertia that is not positive definite; a link would gain energy by turning.
    """
    notes = []
    for number, link in enumerate(bodies_of(model), start=1):
        values, axes = np.linalg.eigh(model.inertias[number].inertia)
        limit = _PRINTED * float(np.abs(values).max())
        principal = ", ".join(f"{value:.4g}" for value in values)
        if values[0] < -limit:
            axis = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
            along = ", ".join(f"{part:.2f}" for part in axis)
            raise RobotError(
                f"{path}: the inertia of link '{link}' is not positive definite: its principal "
                f"values are {principal} kg m^2, the negative one about the axis ({along}). "
                "Correct its six numbers: a sign, the frame, or a product of inertia too large."
            )
        if values[2] > values[0] + values[1] + limit:
            notes.append(
                f"{path.name}: the inertia of link '{link}' is that of no body: of its principal "
                f"values {principal} kg m^2 the largest exceeds the sum of the others."
            )
    return tuple(notes)
