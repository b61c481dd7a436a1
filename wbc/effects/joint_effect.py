"""Effects that sit at a driven joint."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Effect, Motion, Robot


@dataclass(frozen=True)
class JointEffect(Effect, ABC):
    """Base of the effects whose place is one joint.

    Attributes:
        needs_drive: whether the place is a driven joint; else passive joints are places, too.
    """

    needs_drive: ClassVar[bool] = True

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every driven joint, and every passive one where the effect needs no drive."""
        driven = robot.transmission.joints
        return driven if cls.needs_drive else (*driven, *robot.passive_joints)

    def joint_position(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return this joint's position, (...) [rad or m]."""
        return np.asarray(motion.position[..., robot.position_index(self.where)])

    def joint_velocity(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return this joint's velocity, (...) [rad/s or m/s]."""
        return np.asarray(motion.velocity[..., robot.velocity_index(self.where)])

    def on_joint(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return `torque` (...) at this joint's row of a (..., nv) array of zeros."""
        result = np.zeros(motion.velocity.shape)
        result[..., robot.velocity_index(self.where)] = torque
        return result

    def on_rotor(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return `torque` (...) at this gear's column of a (..., m) array of zeros."""
        result = np.zeros((*motion.velocity.shape[:-1], robot.transmission.size))
        result[..., robot.transmission.index(self.where)] = torque
        return result
