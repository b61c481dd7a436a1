"""Where a log holds impacts, which last shorter than its samples can tell."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray
from wbc.identification.records.channels import Channels
from wbc.identification.records.filters.bandwidth import Bandwidth
from wbc.robot import Robot

_JUMP = 0.3  # of the robot's weight, by which a force may change from one sample to the next
_REACH = 2.0  # periods of the kinematic band on both sides, over which the filters carry a jump
_MOST = 0.5  # of a log that may be set aside


def away_from_impacts(robot: Robot, channels: Channels, band: Bandwidth) -> BoolArray:
    """Return (N,) whether a sample is out of the filters' reach of every impact.

    A foot that strikes is stopped within milliseconds. The force's peak falls between two samples
    or on one of them by chance, and no filter can mend what was never recorded. The largest
    impacts go first where all of them would take most of the log.

    Args:
        robot: whose weight is the measure.
        channels: of one log.
        band: of the filters.
    """
    jump = np.zeros(len(channels.time))
    for force in channels.forces.values():
        np.maximum(jump[1:], np.linalg.norm(np.diff(force, axis=0), axis=1), out=jump[1:])
    weight = sum(inertia.mass for inertia in robot.model.inertias) * 9.81
    reach = int(np.ceil(_REACH * channels.rate / band.kinematics))
    away = np.ones(len(jump), dtype=bool)
    for k in np.argsort(-jump):
        if jump[k] < _JUMP * weight or np.mean(away) < 1.0 - _MOST:
            break
        away[max(0, k - reach) : k + reach] = False
    for touches in channels.active.values():
        # A flag says the moment of a touch or a lift as roughly as a sample does.
        for k in np.flatnonzero(np.diff(touches.astype(np.int8))):
            away[max(0, k - reach) : k + reach] = False
    return away
