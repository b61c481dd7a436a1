"""What the motors can give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True)
class RotorTorqueLimit:
    """The rotor torque limits of the robot's transmission, kept through the gears.

    Attributes:
        fraction: share of each limit that the controller may use, in (0, 1].
    """

    fraction: float = 1.0

    def __post_init__(self) -> None:
        """Check the fraction."""
        if not 0.0 < self.fraction <= 1.0:
            raise ControlError(
                f"rotor torque limit: fraction must lie in (0, 1], got {self.fraction:g}."
            )

    def bounds(self, robot: Robot, rotor_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest rotor torque (m,) [N m] at these rotor speeds."""
        upper = self.fraction * robot.transmission.torque_limit
        return -upper, upper
