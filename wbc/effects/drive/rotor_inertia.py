"""A rotor heavier or lighter than the model's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.joint_effect import JointEffect
from wbc.robot import Parameter, Robot, SearchOffer


@final
@dataclass(frozen=True)
class RotorInertia(JointEffect):
    """The rotor's inertia, as it is felt behind the reduction.

    Attributes:
        reflected_inertia: N^2 I_r [kg m^2] at the motor output; replaces the robot's value.
    """

    reflected_inertia: float

    name = "rotor_inertia"
    parameters = (Parameter("reflected_inertia", "kg m^2", 0.0, 0.0, 10000.0, 0.02),)
    explanation = (
        "The spinning rotor, amplified by the square of the gear ratio, is heavier than the "
        "model says."
    )
    experiment = (
        "Shake the joint fast with small strokes about a pose that carries no load: the extra "
        "torque follows the acceleration."
    )
    search = SearchOffer(expected=1.0)

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the robot's present reflected inertia."""
        transmission = robot.transmission
        return {
            "reflected_inertia": float(transmission.reflected_inertia[transmission.index(where)])
        }

    def change(self, robot: Robot) -> Robot:
        """Return the robot with this rotor inertia."""
        transmission = robot.transmission
        ratio = transmission.gear_ratio[transmission.index(self.where)]
        inertia = self.reflected_inertia / float(ratio) ** 2
        return robot.with_transmission(
            transmission.with_value("rotor_inertia", self.where, inertia)
        )
