"""Dry friction of a motor that several joints turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.gear.coupled_gear_effect import CoupledGearEffect
from wbc.robot import Parameter, SearchOffer


@final
@dataclass(frozen=True)
class RotorCoulombFriction(CoupledGearEffect):
    """Dry friction that follows the motor's speed: -level sgn(psi_dot) at the motor's output.

    Attributes:
        level: [N m], at the motor output (N times that on the rotor); replaces the robot's value.
    """

    level: float

    name = "rotor_coulomb_friction"
    number, power = "rotor_coulomb_friction", 1
    parameters = (Parameter("level", "N m", 0.0, 0.0, 10000.0, 0.3),)
    explanation = (
        "The seals and bearings on the motor's side of a coupled gear rub: the torque changes "
        "sign with the speed of the motor, which several joints make together."
    )
    experiment = (
        "Move the joints that share the motor one at a time, then against one another so that the "
        "motor stands still: what rubs at the motor falls away."
    )
    search = SearchOffer(expected=2.0)
