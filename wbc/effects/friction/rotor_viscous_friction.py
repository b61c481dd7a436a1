"""Viscous friction of a motor that several joints turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.gear.coupled_gear_effect import CoupledGearEffect
from wbc.robot import Parameter, SearchOffer


@final
@dataclass(frozen=True)
class RotorViscousFriction(CoupledGearEffect):
    """Friction in proportion to the motor's speed: -coefficient psi_dot at the motor's output.

    Attributes:
        coefficient: [N m s/rad], at the motor output (N^2 times that on the rotor); replaces the
            robot's value.
    """

    coefficient: float

    name = "rotor_viscous_friction"
    number, power = "rotor_viscous_friction", 2
    parameters = (Parameter("coefficient", "N m s/rad", 0.0, 0.0, 10000.0, 0.1),)
    explanation = (
        "Grease is sheared on the motor's side of a coupled gear: a torque grows with the speed of "
        "the motor, which several joints make together."
    )
    experiment = (
        "Move the joints that share the motor one at a time at several speeds, then against one "
        "another so that the motor stands still: what drags at the motor falls away."
    )
    search = SearchOffer(expected=2.0)
