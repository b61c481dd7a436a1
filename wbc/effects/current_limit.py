"""A drive that cannot give what it was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen


@final
@dataclass(frozen=True)
class CurrentLimit(JointEffect):
    """The delivered torque is clipped although the log shows what was asked for.

    Attributes:
        limit: largest torque delivered, at the motor output [N m].
    """

    limit: float

    name: ClassVar[str] = "current_limit"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("limit", "N m", 1e6, 1e-3, 1e6, 1.0),)
    explanation: ClassVar[str] = (
        "The drive limits its current, or the motor saturates: beyond a certain torque the log "
        "shows the wish, not the deed."
    )
    experiment: ClassVar[str] = (
        "Ask for slowly growing torques against a fixed stop with a force sensor: beyond the "
        "limit the force no longer follows."
    )

    @classmethod
    def screening(cls, robot: Robot, where: str, evidence: Evidence) -> tuple[Screen, ...]:
        """Return one screen per limit, between a third and nearly all of the largest torque."""
        column = robot.transmission.index(where)
        ratio = abs(float(robot.transmission.gear_ratio[column]))
        seen = np.abs(np.concatenate([torque[:, column] for torque in evidence.reported])) * ratio
        if not np.any(seen > 0.0):
            return ()
        limits = np.quantile(seen, (0.5, 0.7, 0.8, 0.87, 0.93, 0.97, 0.99, 0.997))
        return tuple(
            Screen.fixed({"limit": float(limit)}) for limit in np.unique(limits) if limit > 1e-3
        )

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the clipped torque of this gear, (..., m)."""
        limit = np.full(robot.transmission.size, np.inf)
        column = robot.transmission.index(self.where)
        limit[column] = self.limit / abs(float(robot.transmission.gear_ratio[column]))
        return np.clip(torque, -limit, limit)
