"""Torque that arrives late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot


@final
@dataclass(frozen=True)
class ActuationDelay(JointEffect):
    """The drive delivers its reported torque `delay` later.

    It needs a series of samples; a single sample passes unchanged, because a simulator or a
    controller that steps through time holds back its own commands.

    Attributes:
        delay: [s].
    """

    delay: float

    name: ClassVar[str] = "actuation_delay"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delay", "s", 0.0, 0.0, 0.2, 0.005),)
    explanation: ClassVar[str] = (
        "Bus, filter and current loop take time: the motor follows the torque that was asked "
        "for a moment ago."
    )
    experiment: ClassVar[str] = (
        "Shake the joint fast with a torque of two frequencies: the error grows with frequency "
        "and follows the rate of change of the torque."
    )

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque of `delay` earlier for this gear, (..., m)."""
        return self._shifted(robot, motion, torque, -self.delay)

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque of `delay` later for this gear, (..., m)."""
        return self._shifted(robot, motion, torque, self.delay)

    def _shifted(
        self, robot: Robot, motion: Motion, torque: FloatArray, shift: float
    ) -> FloatArray:
        if motion.time is None or np.ndim(motion.time) != 1:
            return torque
        column = robot.transmission.index(self.where)
        result = np.array(torque)
        result[:, column] = np.interp(motion.time + shift, motion.time, torque[:, column])
        return result
