"""Little heat in the windings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

from wbc.arrays import FloatArray
from wbc.control.efforts.effort import Effort, GearCost
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class JouleHeatEffort(Effort):
    """weight sum R (tau_phi / k_t)^2 [W], the heat of all windings."""

    name: str = "joule_heat"

    needs: ClassVar[tuple[str, ...]] = ("torque_constant", "resistance")

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the cost of R (tau_phi / k_t)^2 with tau_phi = (e T + rotor share)/N."""
        gears = robot.transmission
        scale = gears.resistance / (gears.torque_constant * gears.gear_ratio) ** 2
        return GearCost(2.0 * self.weight * scale, slope, 1.0)
