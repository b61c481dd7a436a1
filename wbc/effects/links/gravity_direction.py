"""A robot that does not stand upright."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin

from wbc.robot import Effect, Parameter, Robot, SearchOffer


def _freedom(effect: GravityDirection) -> int:
    """The number of axes about which gravity leans."""
    return max(1, sum(value != 0.0 for value in effect.values.values()))


@final
@dataclass(frozen=True)
class GravityDirection(Effect):
    """Gravity leans against the model's: the base or the ground is tilted.

    Attributes:
        roll: rotation of the field about the world's x axis [rad].
        pitch: about the world's y axis [rad].
    """

    roll: float
    pitch: float

    name = "gravity_direction"
    parameters = (
        Parameter("roll", "rad", 0.0, -3.2, 3.2, 0.02),
        Parameter("pitch", "rad", 0.0, -3.2, 3.2, 0.02),
    )
    explanation = (
        "The mounting, the ground or the base's attitude sensor is tilted: gravity pulls "
        "sideways in the model's frame."
    )
    experiment = (
        "Check the base with a spirit level; or hold mirrored poses: the sum of their gravity "
        "torques is not zero."
    )
    search = SearchOffer(freedom=_freedom)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """The whole robot."""
        return ("robot",)

    def change(self, robot: Robot) -> Robot:
        """Return the robot in the tilted field."""
        field = np.asarray(robot.model.gravity.linear)
        return robot.with_gravity(pin.rpy.rpyToMatrix(self.roll, self.pitch, 0.0) @ field)
