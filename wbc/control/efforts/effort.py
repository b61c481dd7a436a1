"""What every effort is: a cost on the torques of the gears."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.robot import Robot, state_gear


class GearCost(NamedTuple):
    """A cost 1/2 sum weight (slope T + rotor share)^2 over the gears.

    Attributes:
        weight: (m,) >= 0.
        slope: (m,) on the output torque T.
        rotor: 1 to add what the rotor itself takes (inertia, friction), 0 not to.
    """

    weight: FloatArray
    slope: FloatArray
    rotor: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Effort(ABC):
    """Something about the gears' torques that should be small; subclasses are final and frozen.

    Where the robot has more ways to move or to push than its tasks decide, efforts choose among
    them; weights small against those of the tasks leave the tasks alone.

    Attributes:
        name: how messages call it.
        weight: >= 0.
    """

    name: str
    weight: float

    needs: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Check the weight."""
        if not 0.0 <= self.weight < np.inf:
            raise ControlError(f"effort '{self.name}': weight must be >= 0, got {self.weight}.")

    def check(self, robot: Robot) -> None:
        """Raise ControlError where a motor lacks one of the numbers that the effort needs."""
        gears = robot.transmission
        for number in self.needs:
            unknown = np.flatnonzero(np.isnan(getattr(gears, number)))
            if unknown.size:
                joint = gears.joints[int(unknown[0])]
                raise ControlError(
                    f"effort '{self.name}': the motor of '{joint}' has no "
                    f"{number}. Use RotorTorqueEffort, or {state_gear(joint, number)}"
                )

    @abstractmethod
    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the quadratic cost of this tick.

        Args:
            robot: the robot.
            slope: e (m,), mesh input per output torque in the predicted directions.
            speed: expected dpsi (m,) [rad/s].
            last_output: T (m,) of the last tick [N m].
        """
