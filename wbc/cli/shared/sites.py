"""Contact and pose of the commands that speak of one contact of a robot."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import RobotError, WbcError
from wbc.robot import Robot


def first_contact(robot: Robot) -> str:
    """Return the name of the robot's first contact.

    Raises:
        RobotError: a robot without contacts.
    """
    if not robot.contacts:
        raise RobotError(
            f"'{robot.name}' has no contact; add [[contacts]] to its description, or name a frame: "
            f"--contact {robot.model.frames[-1].name}."
        )
    return robot.contacts[0].name


def pose_from(robot: Robot, text: str | None) -> FloatArray:
    """Return the pose q (nq,) of `NAME`, of `JOINT=VALUE,...`, or the robot's usual one
    (the neutral one of a robot without poses).

    Raises:
        RobotError: an unknown pose or joint, or text of another form.
    """
    if text is None and not robot.poses:
        return robot.neutral()
    if text is None or "=" not in text:
        return robot.pose(text)
    joints: dict[str, float] = {}
    for item in text.split(","):
        name, _, value = item.partition("=")
        try:
            joints[name.strip()] = float(value)
        except ValueError as cause:
            raise RobotError(f"--pose: '{item}' is not JOINT=VALUE [rad, m].") from cause
    return robot.configuration(**joints)


def checked_axes(axes: str) -> str:
    """Return the world axes that `--axes` names.

    Raises:
        WbcError: none, one twice, or another letter than x, y, z.
    """
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set("xyz"):
        raise WbcError(f"--axes '{axes}': name some of x, y, z, each once.")
    return axes


def main_direction(axes: str) -> FloatArray:
    """Return the unit vector (n,) along z, along the last axis where z is missing."""
    main = "z" if "z" in axes else axes[-1]
    return np.array([1.0 if axis == main else 0.0 for axis in axes])
