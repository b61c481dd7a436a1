"""A motor that gives more or less torque than its drive believes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot, Usual

# Drives are off by ten to thirty per cent; a factor of two and more is a wrong unit or column.
_USUAL = Usual(1.0, 1.0, 0.2, factor=True)


@final
@dataclass(frozen=True)
class TorqueConstant(JointEffect):
    """The drive delivers factor times the torque that it reports.

    Attributes:
        factor: delivered / reported torque.
    """

    factor: float

    name = "torque_constant"
    parameters = (Parameter("factor", "1", 1.0, 0.2, 5.0, 0.1, usual=_USUAL),)
    explanation = (
        "The torque constant in the drive is wrong, or the motor saturates: every torque is "
        "off by the same factor, in both directions of power."
    )
    experiment = (
        "Hang a known weight on the joint and hold it still from above and from below: the "
        "mean torque is off by the factor."
    )

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return factor * torque for this gear, (..., m)."""
        return torque * self._scale(robot, self.factor)

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return torque / factor for this gear, (..., m)."""
        return torque * self._scale(robot, 1.0 / self.factor)

    def _scale(self, robot: Robot, factor: float) -> FloatArray:
        scale = np.ones(robot.transmission.size)
        scale[self.gear(robot)] = factor
        return scale
