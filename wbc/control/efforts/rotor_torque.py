"""Small rotor torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.arrays import FloatArray
from wbc.control.efforts.effort import Effort, GearCost
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class RotorTorqueEffort(Effort):
    """weight/2 sum tau_phi^2 [(N m)^2], losses and rotor inertia included."""

    name: str = "rotor_torque"

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the cost of tau_phi = (e T + rotor share)/N."""
        return GearCost(self.weight / robot.transmission.gear_ratio**2, slope, 1.0)
