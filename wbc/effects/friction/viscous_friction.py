"""Friction proportional to speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot, SearchOffer


def torque(v: FloatArray, coefficient: float) -> FloatArray:
    """Return -coefficient * v (...) [N m]."""
    return -coefficient * v


@final
@dataclass(frozen=True)
class ViscousFriction(JointEffect):
    """A torque -coefficient * v at a joint.

    Attributes:
        coefficient: [N m s/rad], at the joint.
    """

    coefficient: float

    needs_drive = False
    name = "viscous_friction"
    parameters = (Parameter("coefficient", "N m s/rad", 0.0, 0.0, 10000.0, 0.1),)
    explanation = (
        "Lubricant is sheared in bearings and gears: the loss grows in proportion to speed."
    )
    experiment = (
        "Move the joint at several constant speeds in both directions, slow to fast: the "
        "extra torque lies on a straight line through zero."
    )
    search = SearchOffer(expected=2.0)

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -coefficient * v at the joint, (..., nv) [N m]."""
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, torque(speed, self.coefficient))
