"""A constant error of the reported torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot


@final
@dataclass(frozen=True)
class TorqueOffset(JointEffect):
    """The drive delivers its reported torque plus a constant.

    Attributes:
        offset: delivered minus reported, on the motor output side [N m].
    """

    offset: float

    name = "torque_offset"
    parameters = (Parameter("offset", "N m", 0.0, -10000.0, 10000.0, 0.2),)
    explanation = (
        "A current sensor has a zero error, or a constant load such as a tensioned cable is "
        "not in the model."
    )
    experiment = (
        "Hold the joint where it carries no load, approached from both sides: the mean of the "
        "two torques is not zero."
    )

    def rotor_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return offset / N on the rotor, (..., m) [N m]."""
        ratio = robot.transmission.gear_ratio[self.gear(robot)]
        return self.on_rotor(robot, motion, self.offset / ratio)
