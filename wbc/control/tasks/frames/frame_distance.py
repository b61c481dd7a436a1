"""How far two frames should be from each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.tasks.frames.require import require_frame
from wbc.control.tasks.task import Task
from wbc.robot import Robot

_LEAST = 1e-6  # [m] below which a distance has no direction worth the name


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FrameDistanceTask(Task):
    """Distance between the origins of two frames [m].

    With r from one to the other and n = r/|r|, the one row is n'(J_other - J_one) and

        d2|r|/dt2 = n'(a_other - a_one) + |r' - n (n'r')|^2/|r|.

    Attributes:
        frame, other: names of frames of the model.
    """

    name: str = "distance"
    frame: str
    other: str

    def check(self, robot: Robot) -> int:
        """Return 1."""
        require_frame(robot, self.frame, self.name)
        require_frame(robot, self.other, self.name)
        return 1

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the distance, (1,) [m]."""
        return np.array([self._between(kinematics)[1]])

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (1,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return n'(J_other - J_one), (1, nv)."""
        one, other = self._numbers(kinematics)
        rows = kinematics.frame_jacobian(other)[:3] - kinematics.frame_jacobian(one)[:3]
        return np.asarray(self._between(kinematics)[0] @ rows)[None]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dJ/dt v, (1,) [m/s^2]."""
        one, other = self._numbers(kinematics)
        normal, distance = self._between(kinematics)
        along = kinematics.frame_drift(other)[:3] - kinematics.frame_drift(one)[:3]
        rate = kinematics.frame_velocity(other)[:3] - kinematics.frame_velocity(one)[:3]
        across = rate - normal * (normal @ rate)
        return np.array([normal @ along + across @ across / distance])

    def _numbers(self, kinematics: Kinematics) -> tuple[int, int]:
        return kinematics.frame_id(self.frame), kinematics.frame_id(self.other)

    def _between(self, kinematics: Kinematics) -> tuple[FloatArray, float]:
        """Return the direction from one frame to the other (3,), and their distance [m]."""
        one, other = self._numbers(kinematics)
        start = kinematics.placement(one).translation.copy()
        apart = kinematics.placement(other).translation - start
        distance = float(np.linalg.norm(apart))
        if distance < _LEAST:
            return np.array([0.0, 0.0, 1.0]), _LEAST
        return apart / distance, distance
