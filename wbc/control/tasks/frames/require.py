"""Checks that tasks on frames share."""

from __future__ import annotations

from wbc.errors import ControlError, unknown_name
from wbc.robot import Robot


def require_frame(robot: Robot, frame: str, task: str) -> None:
    """Raise ControlError unless the robot has `frame`; the message lists those it has."""
    if not robot.model.existFrame(frame):
        known = [f.name for f in robot.model.frames]
        raise ControlError(
            f"task '{task}': " + unknown_name(f"frame of '{robot.name}'", frame, known)
        )
