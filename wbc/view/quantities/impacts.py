"""Where a recording shows an impact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.quantities.channels import contact_forces

_QUIET = 0.02
_MOMENT = 0.02


@dataclass(frozen=True)
class RecordedImpact:
    """A contact that closes on a moving robot.

    Attributes:
        time: [s].
        contact: its name.
        force: [N] largest force within 20 ms.
    """

    time: float
    contact: str
    force: float


def find_impacts(
    time: FloatArray, forces: Mapping[str, FloatArray], weight: float
) -> tuple[RecordedImpact, ...]:
    """Return the instants at which a contact force rises out of the air.

    A contact that was in the air for 20 ms (force below a fiftieth of the weight) has hit the
    ground when it bears its even share of the weight within another 20 ms.

    Args:
        time: (N,) [s].
        forces: contact name -> (N, 3) [N].
        weight: [N] of the robot.
    """
    impacts = []
    for name, force in forces.items():
        size = np.linalg.norm(force, axis=1)
        free = size < _QUIET * weight
        for row in np.flatnonzero(free[:-1] & ~free[1:]) + 1:
            earlier = np.flatnonzero(~free[:row])
            left = int(earlier[-1]) + 1 if earlier.size else 0
            if time[row] - time[left] < _MOMENT:
                continue
            soon = size[row : int(np.searchsorted(time, time[row] + _MOMENT)) + 1]
            if soon.max() >= weight / len(forces):
                impacts.append(RecordedImpact(float(time[row]), name, float(soon.max())))
    return tuple(sorted(impacts, key=lambda impact: impact.time))


def log_impacts(robot: Robot, log: Log) -> tuple[RecordedImpact, ...]:
    """Return the impacts that the contact forces of a log show."""
    return find_impacts(log.time, contact_forces(robot, log), robot_weight(robot))


def robot_weight(robot: Robot) -> float:
    """Return the weight of all moving bodies [N]."""
    gravity = float(np.linalg.norm(robot.model.gravity.linear))
    return float(pin.computeTotalMass(robot.model)) * gravity
