"""What a model file says and a tree of links cannot hold: loops, couplings, springs, motors."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

_LOOPS = ("connect", "weld")


def left_out(path: Path) -> tuple[str, ...]:
    """Return notes on the parts of a URDF or MJCF file that the model does not keep.

    Args:
        path: a `.urdf` or MJCF `.xml` file that could be read; parts that an MJCF includes from
            other files are not looked at.
    """
    try:
        root = ET.parse(path).getroot()
    except ET.ParseError:
        return ()
    found = _of_urdf(root) if path.suffix == ".urdf" else _of_mjcf(root)
    return tuple(f"{path.name}: {text}" for text in found)


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
    for equality in root.iter("equality"):
        for item in equality:
            ends = [item.get(key) for key in ("body1", "body2", "joint1", "joint2", "site1")]
            between = " and ".join(end for end in ends if end) or item.get("name", "")
            kind = "closes a loop" if item.tag in _LOOPS else "couples joints"
            notes.append(
                f"equality '{item.tag}' of {between} {kind} and was left out: links form a tree "
                "here. A parallelogram or belt is the topology of [transmission]."
            )
    for name, meaning in (
        ("stiffness", "add a joint_spring"),
        ("springref", "the rest angle of a joint_spring"),
    ):
        held = [
            f"{joint.get('name', 'of a default class')} {joint.get(name)}"
            for joint in root.iter("joint")
            if joint.get(name) and any(float(x) != 0.0 for x in joint.get(name, "").split())
        ]
        if held:
            notes.append(f"{name} ({', '.join(held)}) was left out; {meaning}.")
    ranges = [
        f"{motor.get('joint', motor.get('name', motor.tag))} [{motor.get('ctrlrange')}]"
        for actuators in root.iter("actuator")
        for motor in actuators
        if motor.get("ctrlrange")
    ]
    if ranges:
        notes.append(
            f"ctrlrange ({', '.join(ranges)}) was left out; give torque_limit of the gears in "
            "robot.toml."
        )
    keys = [key.get("name", "without a name") for frame in root.iter("keyframe") for key in frame]
    if keys:
        notes.append(f"keyframes ({', '.join(keys)}) were left out; give them as [poses].")
    return notes
