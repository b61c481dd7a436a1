"""A supply that gives in under load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Effect, Motion, Parameter, Robot


@final
@dataclass(frozen=True)
class SupplySag(Effect):
    """All drives deliver less while the motors together draw power: 1 - coefficient * P.

    P is the mechanical power of all rotors, as reported, where it is positive.

    Attributes:
        coefficient: share of the torque lost per watt [1/W].
    """

    coefficient: float

    name: ClassVar[str] = "supply_sag"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("coefficient", "1/W", 0.0, 0.0, 1.0, 0.001),
    )
    explanation: ClassVar[str] = (
        "Battery and cables have resistance: when the motors draw power the voltage falls and "
        "every drive gives less than it reports."
    )
    experiment: ClassVar[str] = (
        "Log the supply voltage while several joints accelerate at once: the torque error "
        "follows the total power, also on joints that do little themselves."
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """The whole robot: one supply feeds all drives."""
        return ("robot",)

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque left, (..., m)."""
        return np.asarray(torque * self._factor(robot, motion, torque))

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque reported for a delivered one, by a few fixed-point steps, (..., m)."""
        reported = torque
        for _ in range(8):
            reported = torque / self._factor(robot, motion, reported)
        return np.asarray(reported)

    def _factor(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        gears = robot.transmission
        spin = motion.velocity[..., robot.actuated] @ gears.motor_from_joint.T * gears.gear_ratio
        power = np.maximum(np.sum(torque * spin, axis=-1, keepdims=True), 0.0)
        return np.asarray(np.maximum(1.0 - self.coefficient * power, 0.1))
