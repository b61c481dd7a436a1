"""Where the origin of a frame should be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.frames import require_frame
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePositionTask(Task):
    """Position of a frame's origin along some world axes [m].

    Attributes:
        frame: name of a frame of the model.
        axes: which of "xyz" belong to the task.
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
        """Return the origin along the axes, (k,) [m]."""
        placement = kinematics.placement(kinematics.frame_id(self.frame))
        return np.asarray(placement.translation[self._rows])

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (k,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of the frame's linear Jacobian, world axes, (k, nv)."""
        return kinematics.frame_jacobian(kinematics.frame_id(self.frame))[self._rows]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the linear acceleration at qdd = 0, world axes, (k,) [m/s^2]."""
        return kinematics.frame_drift(kinematics.frame_id(self.frame))[self._rows]
