"""What the motors can give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True)
class RotorTorqueLimit:
    """The rotor torque limits of the robot's transmission, kept through the gears.

    Attributes:
        fraction: share of each limit that the controller may use, in (0, 1].
        knee: share of the transmission's speed limit up to which the full torque is there; beyond
            it the torque along the motion falls in a straight line to nothing at the speed limit,
            as that of a motor at its voltage limit does. Braking keeps the full torque. None
            leaves the torque independent of speed.
    """

    fraction: float = 1.0
    knee: float | None = None

    def __post_init__(self) -> None:
        """Check the fraction."""
        if not 0.0 < self.fraction <= 1.0:
            raise ControlError(
                f"rotor torque limit: fraction must lie in (0, 1], got {self.fraction:g}."
            )
        if self.knee is not None and not 0.0 <= self.knee < 1.0:
            raise ControlError(f"rotor torque limit: knee must lie in [0, 1), got {self.knee:g}.")

    @property
    def is_constant(self) -> bool:
        """Whether the bounds are the same at every speed."""
        return self.knee is None

    def bounds(self, robot: Robot, rotor_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest rotor torque (m,) [N m] at these rotor speeds."""
        full = self.fraction * robot.transmission.torque_limit
        if self.knee is None:
            return -full, full
        top = robot.transmission.speed_limit
        with np.errstate(invalid="ignore"):
            used = np.abs(rotor_speed) / top
        left = np.clip((1.0 - used) / (1.0 - self.knee), 0.0, 1.0)
        along = np.where(np.isfinite(top), left, 1.0) * full
        forward = rotor_speed >= 0.0
        return np.where(forward, -full, -along), np.where(forward, along, full)
