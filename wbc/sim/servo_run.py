"""What a position servo was told during one run, on an even clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement import Log, Machine


@dataclass(frozen=True, eq=False)
class ServoRun:
    """Set point, power state and measured position of one joint.

    Attributes:
        name: of the log.
        gain: of the position loop in this run, duty per rad of error [1/rad].
        goal: (T,) set point [rad or m].
        enabled: (T,) 1 while powered, 0 while the winding is open.
        position: (T,) measured [rad or m]; its first value starts a simulation, at rest.
        machine: how drive and load of this run differ from the robot, None if in nothing.
    """

    name: str
    gain: float
    goal: FloatArray
    enabled: FloatArray
    position: FloatArray
    machine: Machine | None = None

    @classmethod
    def from_log(cls, log: Log, joint: str, gain: float, step: float) -> ServoRun:
        """Return the run of a log with position, target_position and, if there is one, enabled.

        Args:
            log: the log.
            joint: name of the driven joint.
            gain: of the position loop, duty per rad.
            step: time step of the even clock [s].

        Raises:
            LogError: a channel is missing.
        """
        for quantity in ("position", "target_position"):
            if not log.has(f"{joint}.{quantity}"):
                raise LogError(
                    f"{log.source.label}: the column '{joint}.{quantity}' is missing; a servo's "
                    "rollout needs position and set point."
                )
        time = np.arange(log.time[0], log.time[-1], step)
        last = np.searchsorted(log.time, time, side="right") - 1
        enabled = log.columns.get(f"{joint}.enabled", np.ones(len(log)))
        return cls(
            name=log.source.part or log.source.label,
            gain=gain,
            goal=np.interp(time, log.time, log.column(f"{joint}.target_position")),
            enabled=np.asarray(enabled[last]),
            position=np.interp(time, log.time, log.columns[f"{joint}.position"]),
            machine=log.machine,
        )
