"""Where a frame should be and how it should be turned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.frame_task import FrameTask, turn_missing
from wbc.control.tasks.targets import pose_target

_ALL = slice(0, 6)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePoseTask(FrameTask):
    """Pose of a frame; the value is a `pin.SE3`, world from frame.

    Rows are the position's error [m] over the rotation vector R log3(R' R_target) [rad], both in
    world axes. Relative to another frame, that frame stands for the world.
    """

    def rows(self) -> slice:
        """Return all six rows."""
        return _ALL

    def value(self, kinematics: Kinematics) -> pin.SE3:
        """Return the placement, world from frame."""
        return self.placement(kinematics).copy()

    def admitted(self, target: Target, size: int) -> pin.SE3:
        """Return a `pin.SE3`, checked and copied."""
        return pose_target(target)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return [p_target - p; R log3(R' R_target)], world axes, (6,)."""
        placement = self.placement(kinematics)
        result = np.empty(6)
        result[:3] = target.translation - placement.translation
        result[3:] = turn_missing(placement, target.rotation)
        return result

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target as a placement (12,)."""
        place[:9], place[9:] = target.rotation.T.reshape(-1), target.translation
