"""Named configurations of a robot, from its description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wbc.arrays import FloatArray, frozen
from wbc.errors import RobotError, unknown_name
from wbc.robot.loading.table import number_in
from wbc.robot.robot import Robot

_BASE = ("base.position.x", "base.position.y", "base.position.z")


def named_poses(robot: Robot, table: Any, place: str) -> Mapping[str, FloatArray]:
    """Return pose name -> q (nq,), joints left out being at their neutral position.

    Args:
        robot: the robot whose joints the poses set.
        table: `[poses.NAME]` tables of joint = {value, unit, source}; a free-flyer's position is
            set with base.position.x|y|z.
        place: the file, for messages.

    Raises:
        RobotError: no table, an unknown joint, or no number.
    """
    if not isinstance(table, Mapping):
        raise RobotError(f"{place}: poses: one table per pose expected, [poses.NAME].")
    return {
        str(name): _pose(robot, entry, f"{place}: pose '{name}'") for name, entry in table.items()
    }


def _pose(robot: Robot, entry: Any, place: str) -> FloatArray:
    if not isinstance(entry, Mapping):
        raise RobotError(f"{place}: a table of joints expected, got {entry!r}.")
    known = (*robot.single_joints, *(_BASE if robot.has_free_flyer else ()))
    q = robot.neutral()
    for joint, value in entry.items():
        if joint not in known:
            raise RobotError(f"{place}: " + unknown_name("joint", joint, known))
        if joint in _BASE:
            q[_BASE.index(joint)] = number_in(value, "m", f"{place}: {joint}")
            continue
        model = robot.model.joints[robot.model.getJointId(joint)]
        unit = "m" if model.shortname().startswith("JointModelP") else "rad"
        q[robot.position_index(joint)] = number_in(value, unit, f"{place}: {joint}")
    return frozen(q)
