"""Where the capture point should be."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, RowKind, StateRows
from wbc.control.reference import Reference, Target
from wbc.control.tasks.task import Task
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CapturePointTask(Task):
    """The capture point, or divergent component of motion, along x and y of the world [m].

    With c the centre of mass and b = sqrt(g/height), xi = c + c'/b runs away from the centre of
    pressure, c follows it by itself (Pratt 2006, Englsberger 2015). The task wants

        xi' = xi'_ref + stiffness (xi_ref - xi),    c'' = b (xi' - c')

    with a stiffness in [1/s]; `Reference.position` is xi_ref and `Reference.velocity` xi'_ref. Kept
    inside the soles, xi can be stopped without a step.

    Attributes:
        height: [m] of the centre of mass above the ground that b is computed with.
    """

    name: str = "capture_point"
    stiffness: float = 5.0
    height: float

    def __post_init__(self) -> None:
        """Check the height."""
        super().__post_init__()
        if not 0.0 < self.height < np.inf:
            raise ControlError(f"task '{self.name}': height must be > 0 m, got {self.height}.")

    def check(self, robot: Robot) -> int:
        """Return 2."""
        return 2

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return xi (2,) [m]."""
        rate = self.jacobian(kinematics) @ kinematics.velocity
        return np.asarray(kinematics.center_of_mass()[:2] + rate / self._pole(kinematics))

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (2,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the x and y rows of J_com, (2, nv)."""
        return kinematics.center_of_mass_jacobian()[:2]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the x and y rows of dJ_com/dt v, (2,) [m/s^2]."""
        return kinematics.center_of_mass_drift()[:2]

    @property
    def state_rows(self) -> StateRows:
        """The x and y axes of the centre of mass."""
        return StateRows(RowKind.CENTER_OF_MASS, "", slice(0, 2))

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write nothing: the target is fed back by `command`."""

    def command(self, kinematics: Kinematics, reference: Reference, rate: FloatArray) -> FloatArray:
        """Return c'' wanted, (2,) [m/s^2]."""
        pole = self._pole(kinematics)
        point = kinematics.center_of_mass()[:2] + rate / pole
        wanted = self.stiffness * (np.asarray(reference.position) - point)
        if reference.velocity is not None:
            wanted = wanted + reference.velocity
        found = pole * (wanted - rate)
        return np.asarray(
            found if reference.acceleration is None else found + reference.acceleration
        )

    def _pole(self, kinematics: Kinematics) -> float:
        return sqrt(kinematics.gravity / self.height)
