"""Where the origin of a frame should be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.frame_task import FrameTask


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePositionTask(FrameTask):
    """Position of a frame's origin along some axes of the world, or of another frame [m].

    Attributes:
        axes: which of "xyz" belong to the task.
    """

    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        object.__setattr__(self, "_rows", axis_rows(self.axes, self.name))

    def rows(self) -> slice:
        """Return the linear rows of the axes."""
        return self._rows

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the origin along the axes, (k,) [m]."""
        return np.asarray(self.placement(kinematics).translation[self._rows])

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (k,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (k,) as the origin of a placement (12,)."""
        place[9:][self._rows] = target
