"""How a frame should be turned."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.frames import require_frame
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FrameOrientationTask(Task):
    """Orientation of a frame; the value is its rotation matrix (3, 3), world from frame.

    The error is the rotation vector R log3(R' R_target) in world axes [rad], of which the task
    takes some components.

    Attributes:
        frame: name of a frame of the model.
        axes: which of "xyz" belong to the task, "y" for the pitch of a planar robot.
    """

    frame: str
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        object.__setattr__(self, "_rows", axis_rows(self.axes, self.name))

    def check(self, robot: Robot) -> int:
        """Return the number of axes."""
        require_frame(robot, self.frame, self.name)
        return len(self.axes)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the rotation matrix, world from frame, (3, 3)."""
        placement = kinematics.placement(kinematics.frame_id(self.frame))
        return np.asarray(placement.rotation)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return the components of R log3(R' R_target), world axes, (k,) [rad]."""
        rotation = self.value(kinematics)
        return np.asarray((rotation @ pin.log3(rotation.T @ target))[self._rows])

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of the frame's angular Jacobian, world axes, (k, nv)."""
        return kinematics.frame_jacobian(kinematics.frame_id(self.frame))[3:][self._rows]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the angular acceleration at qdd = 0, world axes, (k,) [rad/s^2]."""
        return kinematics.frame_drift(kinematics.frame_id(self.frame))[3:][self._rows]
