"""Effects that sit at a motor which does not turn with one joint alone."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass

import numpy as np

from wbc.effects.joint_effect import RotorNumber
from wbc.errors import EffectError, unknown_name
from wbc.robot import Robot


@dataclass(frozen=True)
class CoupledGearEffect(RotorNumber, ABC):
    """Base of the effects whose place is a motor that several joints turn.

    Where a motor turns with its joint alone, what happens at the motor cannot be told from what
    happens at the joint, and the effects of the joint stand for both; a torque sensor behind the
    gear tells the two apart.
    """

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every gear that a topology D couples, or with a torque sensor, by its joint's name."""
        gears = robot.transmission
        coupled = np.count_nonzero(gears.motor_from_joint, axis=1) > 1
        coupled[robot.sensed] = True
        return tuple(joint for joint, yes in zip(gears.joints, coupled, strict=True) if yes)

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless `where` is a driven joint.

        A robot keeps what its sensors showed when it is used without them.
        """
        joints = robot.transmission.joints
        if self.where not in joints:
            raise EffectError(unknown_name(f"place for {self.name}", self.where, joints))
