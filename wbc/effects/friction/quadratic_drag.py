"""Drag that grows with the square of speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot


def torque(v: FloatArray, coefficient: float) -> FloatArray:
    """Return -coefficient * |v| v (...) [N m]."""
    return -coefficient * np.abs(v) * v


@final
@dataclass(frozen=True)
class QuadraticDrag(JointEffect):
    """A torque -coefficient * |v| v at a joint.

    Attributes:
        coefficient: [N m s^2/rad^2], at the joint.
    """

    coefficient: float

    name = "quadratic_drag"
    parameters = (Parameter("coefficient", "N m s^2/rad^2", 0.0, 0.0, 10000.0, 0.05),)
    explanation = "Air or churned oil is thrown aside: the loss grows with the square of speed."
    experiment = (
        "Move the joint at several constant speeds up to the fastest: torque over speed rises "
        "in a straight line instead of being constant."
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -coefficient * |v| v at the joint, (..., nv) [N m]."""
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, torque(speed, self.coefficient))
