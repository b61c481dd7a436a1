"""What tasks on the centroidal momentum share."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Reference, Target
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumTask(Task):
    """Rows of the momentum about the centre of mass; subclasses are final and choose them.

    The value is itself a rate, so the task wants

        dh/dt = A_g qdd + dA_g/dt v = dh_ref/dt + stiffness (h_ref - h)

    with a stiffness in [1/s]; `Reference.position` is h_ref and `Reference.velocity` dh_ref/dt.
    """

    stiffness: float = 10.0

    def check(self, robot: Robot) -> int:
        """Return the number of rows."""
        return len(range(*self.rows().indices(6)))

    @abstractmethod
    def rows(self) -> slice:
        """Return which of the six rows, linear over angular, the task has."""

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return h (k,) [kg m/s, N m s]."""
        return np.asarray(self.jacobian(kinematics) @ kinematics.velocity)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return h_ref - h, (k,) [kg m/s, N m s]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of the centroidal momentum matrix, (k, nv)."""
        return kinematics.momentum_matrix()[self.rows()]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dA_g/dt v, (k,) [N, N m]."""
        return kinematics.momentum_drift()[self.rows()]

    def command(self, kinematics: Kinematics, reference: Reference, rate: FloatArray) -> FloatArray:
        """Return dh/dt wanted, (k,) [N, N m]; the present rate J v is h itself."""
        wanted = self.stiffness * (np.asarray(reference.position) - rate)
        if reference.velocity is not None:
            wanted = wanted + reference.velocity
        return np.asarray(wanted)
