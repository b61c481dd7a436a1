"""Small torques at the outputs of the gears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.efforts.effort import Effort, GearCost
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class OutputTorqueEffort(Effort):
    """weight/2 sum T^2 [(N m)^2], the torque that leaves each gear (joint torque where D = 1)."""

    name: str = "output_torque"

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the cost of T."""
        return GearCost(np.full(slope.shape, self.weight), np.ones(slope.shape), 0.0)
