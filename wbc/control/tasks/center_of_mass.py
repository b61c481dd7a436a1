"""Where the centre of mass should be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, RowKind, StateRows
from wbc.control.reference import Target
from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CenterOfMassTask(Task):
    """Position of the centre of mass along some world axes [m].

    Attributes:
        axes: which of "xyz" belong to the task, for example "xz" or "z".
    """

    name: str = "center_of_mass"
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        object.__setattr__(self, "_rows", axis_rows(self.axes, self.name))

    def check(self, robot: Robot) -> int:
        """Return the number of axes."""
        return len(self.axes)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the centre of mass along the axes, (k,) [m]."""
        return kinematics.center_of_mass()[self._rows]

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (k,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of J_com, (k, nv)."""
        return kinematics.center_of_mass_jacobian()[self._rows]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of dJ_com/dt v, (k,) [m/s^2]."""
        return kinematics.center_of_mass_drift()[self._rows]

    @property
    def state_rows(self) -> StateRows:
        """The axes of the centre of mass."""
        return StateRows(RowKind.CENTER_OF_MASS, "", self._rows)

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (k,) as the origin of a placement (12,)."""
        place[9:][self._rows] = target
