"""What a diagnosis reads of a torque along a motion: a low band, and no rows about a reversal."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.records.filters import SPREAD, gate
from wbc.identification.records.preparation import REVERSAL
from wbc.robot import Motion, Robot

BAND = 5.0
"""[Hz] that a diagnosis keeps of a torque, where no diagnosis of the robot says it. It takes 3 to
15 Hz, above which accelerations from the encoders are noisier than the torque; of twelve arms of
the corpus with their sensors, half are kept to less than 5.2 Hz."""


class ReadableRows:
    """Which part of the torques along a motion a diagnosis compares."""

    def __init__(self, robot: Robot, motion: Motion, band: float) -> None:
        """Find the rows to trust; all of them, and all frequencies, with an infinite band [Hz]."""
        time = motion.time
        self._weight = np.ones((len(motion.position), robot.transmission.size))
        self._gain: FloatArray | None = None
        if not np.isfinite(band) or time is None:
            return
        frequency = np.fft.rfftfreq(2 * len(time), float(time[1] - time[0]))
        # Butterworth's filter of fourth order, forth and back.
        self._gain = np.asarray(1.0 / (1.0 + (frequency / band) ** 8), dtype=np.float64)
        self._weight = _trust(robot, motion, 1.0 / (SPREAD * band))

    def of(self, torque: FloatArray) -> FloatArray:
        """Return torques (N, m, ...) in the band, weighted by how far each row is trusted."""
        weight = self._weight.reshape(self._weight.shape + (1,) * (torque.ndim - 2))
        if self._gain is None:
            return np.asarray(weight * torque)
        # Mirrored in time, so that there is no jump at the ends.
        both = np.concatenate([torque, torque[::-1]])
        gain = self._gain.reshape(-1, *(1,) * (torque.ndim - 1))
        low = np.fft.irfft(gain * np.fft.rfft(both, axis=0), len(both), axis=0)
        return np.asarray(weight * low[: len(torque)])


def _trust(robot: Robot, motion: Motion, period: float) -> FloatArray:
    """Return weights (N, m): 0 where a joint that a gear moves turns round, 1 where it moves."""
    velocity = motion.velocity[:, robot.actuated]
    acceleration = np.asarray(motion.acceleration)[:, robot.actuated]
    lasting = REVERSAL * period * np.sqrt(np.mean(acceleration**2, axis=0))
    typical = 0.5 * np.sqrt(np.mean(velocity**2, axis=0))
    each = gate(velocity, np.minimum(lasting, typical))
    moves = np.abs(robot.transmission.topology.T) > 0.0
    return np.stack([each[:, own].min(axis=1) for own in moves], axis=1)
