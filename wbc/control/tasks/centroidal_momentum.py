"""How the whole robot should turn about its centre of mass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Reference, Target
from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class AngularMomentumTask(Task):
    """Angular momentum about the centre of mass along some world axes [N m s].

    The value is itself a rate, so the task wants

        dh/dt = A_g qdd + dA_g/dt v = dh_ref/dt + stiffness (h_ref - h)

    with a stiffness in [1/s]; `Reference.position` is h_ref and `Reference.velocity` dh_ref/dt.

    Attributes:
        axes: which of "xyz" belong to the task, "y" for a planar robot.
    """

    name: str = "angular_momentum"
    stiffness: float = 10.0
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
        """Return h (k,) [N m s]."""
        return np.asarray(self.jacobian(kinematics) @ kinematics.velocity)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return h_ref - h, (k,) [N m s]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the angular rows of the centroidal momentum matrix, (k, nv)."""
        return kinematics.momentum_matrix()[3:][self._rows]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dA_g/dt v, (k,) [N m]."""
        return kinematics.momentum_drift()[3:][self._rows]

    def command(self, kinematics: Kinematics, reference: Reference, rate: FloatArray) -> FloatArray:
        """Return dh/dt wanted, (k,) [N m]; the present rate J v is h itself."""
        wanted = self.stiffness * (np.asarray(reference.position) - rate)
        if reference.velocity is not None:
            wanted = wanted + reference.velocity
        return np.asarray(wanted)
