"""Where a frame should be and how it should be turned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.frames import require_frame
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePoseTask(Task):
    """Pose of a frame; the value is a `pin.SE3`, world from frame.

    Rows are the position's error [m] over the rotation vector R log3(R' R_target) [rad], both in
    world axes.

    Attributes:
        frame: name of a frame of the model.
    """

    frame: str

    def check(self, robot: Robot) -> int:
        """Return 6."""
        require_frame(robot, self.frame, self.name)
        return 6

    def value(self, kinematics: Kinematics) -> pin.SE3:
        """Return the placement, world from frame."""
        return kinematics.placement(kinematics.frame_id(self.frame)).copy()

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return [p_target - p; R log3(R' R_target)], world axes, (6,)."""
        placement = kinematics.placement(kinematics.frame_id(self.frame))
        rotation = placement.rotation
        result = np.empty(6)
        result[:3] = target.translation - placement.translation
        result[3:] = rotation @ pin.log3(rotation.T @ target.rotation)
        return result

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the frame's Jacobian, world axes, (6, nv)."""
        return kinematics.frame_jacobian(kinematics.frame_id(self.frame))

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the frame's classical acceleration at qdd = 0, world axes, (6,)."""
        return kinematics.frame_drift(kinematics.frame_id(self.frame))
