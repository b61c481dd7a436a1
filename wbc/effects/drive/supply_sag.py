"""A supply that gives in under load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Effect, Motion, Parameter, Robot

_LEAST = 0.1  # share of the torque that is left, however much power is drawn


@final
@dataclass(frozen=True)
class SupplySag(Effect):
    """All drives deliver less while the motors together draw power: 1 - coefficient * P.

    P is the electrical power of all motors, as reported, where it is positive: torque times speed
    plus what warms the windings, resistance (torque / torque_constant)^2. A stalled motor draws
    the latter. Motors whose winding is not described count with torque times speed alone.

    Attributes:
        coefficient: share of the torque lost per watt [1/W].
    """

    coefficient: float

    name = "supply_sag"
    parameters = (Parameter("coefficient", "1/W", 0.0, 0.0, 1.0, 0.001),)
    explanation = (
        "Battery and cables have resistance: when the motors draw power the voltage falls and "
        "every drive gives less than it reports."
    )
    experiment = (
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
        """Return the torque reported for a delivered one, (..., m).

        The share f that is delivered solves f = 1 - coefficient (P_shaft / f + P_heat / f^2), P
        being the powers of the delivered torque. Newton's method from f = 1 meets the largest
        root, the one at which more drive still gives more torque.
        """
        shaft, heat = self._powers(robot, motion, torque)
        share = np.ones_like(shaft)
        for _ in range(12):
            power = shaft / share + heat / share**2
            draws = power > 0.0
            miss = 1.0 - self.coefficient * np.where(draws, power, 0.0) - share
            growth = self.coefficient * (shaft / share**2 + 2.0 * heat / share**3)
            slope = np.where(draws, growth, 0.0) - 1.0
            step = np.where(slope < 0.0, miss / np.where(slope < 0.0, slope, -1.0), share)
            share = np.clip(share - step, _LEAST, 1.0)
        return np.asarray(torque / share)

    def _factor(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        power = np.maximum(np.add(*self._powers(robot, motion, torque)), 0.0)
        return np.asarray(np.maximum(1.0 - self.coefficient * power, _LEAST))

    @staticmethod
    def _powers(robot: Robot, motion: Motion, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the power of all motors at their shafts and in their windings, (..., 1) [W]."""
        gears = robot.transmission
        spin = motion.velocity[..., robot.actuated] @ gears.motor_from_joint.T * gears.gear_ratio
        ohmic = np.nan_to_num(gears.copper_loss)
        return (
            np.sum(torque * spin, axis=-1, keepdims=True),
            np.sum(ohmic * torque**2, axis=-1, keepdims=True),
        )
