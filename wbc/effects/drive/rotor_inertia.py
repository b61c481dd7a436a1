"""A rotor heavier or lighter than the model's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.joint_effect import RotorNumber
from wbc.robot import Parameter, SearchOffer


@final
@dataclass(frozen=True)
class RotorInertia(RotorNumber):
    """The rotor's inertia, as it is felt behind the reduction.

    Attributes:
        reflected_inertia: N^2 I_r [kg m^2] at the motor output; replaces the robot's value.
    """

    reflected_inertia: float

    name = "rotor_inertia"
    number, power = "rotor_inertia", 2
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
