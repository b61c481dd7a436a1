"""Little power lost in the gears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.efforts.effort import Effort, GearCost
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class MeshLossEffort(Effort):
    """weight sum (t - T) dpsi [W], what the meshes turn into heat.

    The loss is |e - 1| |dpsi| |T|; its absolute value is majorised by a parabola through the last
    tick's torque, |T| <= T^2/(2 |T_0|) + |T_0|/2, which ticks that follow one another closely
    turn into the absolute value itself.

    Attributes:
        least_torque: [N m] under which |T_0| is not taken, so that the parabola stays finite.
    """

    name: str = "mesh_loss"
    least_torque: float = 0.5

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if not self.least_torque > 0.0:
            raise ControlError(f"effort '{self.name}': least_torque must be > 0 N m.")

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the parabola that touches the loss at the last tick's torque."""
        rate = np.abs(slope - 1.0) * np.abs(speed)
        size = np.maximum(np.abs(last_output), self.least_torque)
        return GearCost(self.weight * rate / size, np.ones(slope.shape), 0.0)
