"""One robot, one file: the text in a format, and what the format cannot say."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from xml.etree import ElementTree as ET

from wbc.errors import RobotError, require_known
from wbc.export.joint_numbers import joint_numbers
from wbc.export.loss_numbers import TOLD, loss_module
from wbc.export.mjcf import mjcf
from wbc.export.urdf import urdf
from wbc.files import write_text
from wbc.robot import Robot

FORMATS = {"mujoco": ".xml", "mjcf": ".xml", "urdf": ".urdf"}
"""Format -> ending of its file."""


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
