"""How a frame should be turned."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.frame_task import FrameTask, turn_missing
from wbc.control.tasks.targets import rotation_target


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FrameOrientationTask(FrameTask):
    """Orientation of a frame; the value is its rotation matrix (3, 3), world from frame.

    The error is the rotation vector R log3(R' R_target) in world axes [rad], of which the task
    takes some components. Relative to another frame, that frame stands for the world.

    Attributes:
        axes: which of "xyz" belong to the task, "y" for the pitch of a planar robot.
    """

    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)
    _angular: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        rows = axis_rows(self.axes, self.name)
        object.__setattr__(self, "_rows", rows)
        object.__setattr__(self, "_angular", slice(rows.start + 3, rows.stop + 3, rows.step))

    def rows(self) -> slice:
        """Return the angular rows of the axes."""
        return self._angular

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the rotation matrix, world from frame, (3, 3)."""
        return np.asarray(self.placement(kinematics).rotation)

    def admitted(self, target: Target, size: int) -> FloatArray:
        """Return a rotation matrix (3, 3), checked and copied."""
        return rotation_target(target)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return the components of R log3(R' R_target), world axes, (k,) [rad]."""
        return turn_missing(self.placement(kinematics), target)[self._rows]

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (3, 3) as the rotation of a placement (12,)."""
        place[:9] = target.T.reshape(-1)
