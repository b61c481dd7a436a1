"""Where a frame should look."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2
from typing import final

import numpy as np

from wbc.arrays import FloatArray, checked
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.frames.require import require_frame
from wbc.control.tasks.targets import vector_target
from wbc.control.tasks.task import Task
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class GazeTask(Task):
    """An axis of a frame points at a place; turning about that axis is free.

    With a the axis and d the direction from the frame's origin to the place, both of length one,
    the error is the smallest turn from a to d in the two directions across a [rad]. The rows are
    the angular velocity in these directions; that the origin moves is left to the feedback.
    `Reference.position` is the place (3,) [m] in the world.

    Attributes:
        frame: name of a frame of the model.
        axis: (3,) direction in the frame that looks.
    """

    name: str = "gaze"
    frame: str
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    _axis: FloatArray = field(init=False, repr=False)
    _across: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axis and find two directions across it."""
        super().__post_init__()
        axis = np.array(checked(self.axis, (3,), f"task '{self.name}': axis", ControlError))
        length = float(np.linalg.norm(axis))
        if not length > 0.0:
            raise ControlError(f"task '{self.name}': axis must have a direction, got {self.axis}.")
        axis /= length
        side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        side /= np.linalg.norm(side)
        object.__setattr__(self, "_axis", axis)
        object.__setattr__(self, "_across", np.array([side, np.cross(axis, side)]))

    def check(self, robot: Robot) -> int:
        """Return 2."""
        require_frame(robot, self.frame, self.name)
        return 2

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the place (3,) one metre ahead in the line of sight, world [m]."""
        place = kinematics.placement(kinematics.frame_id(self.frame))
        return np.asarray(place.translation + place.rotation @ self._axis)

    def admitted(self, target: Target, size: int) -> FloatArray:
        """Return a place (3,), checked and copied."""
        return vector_target(target, 3)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return the turn that is missing, in the two directions across the axis, (2,) [rad]."""
        place = kinematics.placement(kinematics.frame_id(self.frame))
        ahead = place.rotation.T @ (target - place.translation)  # in the frame
        turn = np.cross(self._axis, ahead)
        sine, cosine = float(np.linalg.norm(turn)), float(self._axis @ ahead)
        if sine == 0.0:  # straight ahead or straight behind
            return np.array([0.0 if cosine >= 0.0 else np.pi, 0.0])
        return np.asarray(self._across @ turn * (atan2(sine, cosine) / sine))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the angular rows across the axis, (2, nv)."""
        number = kinematics.frame_id(self.frame)
        across = self._across @ kinematics.placement(number).rotation.T
        return np.asarray(across @ kinematics.frame_jacobian(number)[3:])

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dJ/dt v, (2,) [rad/s^2]; the turning of the directions adds (w x b)'w = 0."""
        number = kinematics.frame_id(self.frame)
        across = self._across @ kinematics.placement(number).rotation.T
        return np.asarray(across @ kinematics.frame_drift(number)[3:])
