"""Viscous friction of a motor that several joints turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.gear.coupled_gear_effect import CoupledGearEffect
from wbc.robot import Parameter, Robot, SearchOffer


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

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the robot's present friction."""
        gears, column = robot.transmission, robot.transmission.index(where)
        ratio = float(gears.gear_ratio[column])
        return {"coefficient": float(gears.rotor_viscous_friction[column] * ratio**2)}

    def change(self, robot: Robot) -> Robot:
        """Return the robot whose rotor is dragged that much."""
        gears = robot.transmission
        coefficient = self.coefficient / self.ratio(robot) ** 2
        return robot.with_transmission(
            gears.with_value("rotor_viscous_friction", self.where, coefficient)
        )
