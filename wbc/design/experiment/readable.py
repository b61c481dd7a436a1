"""What a diagnosis reads of a torque along a motion: a low band, and no rows about a reversal."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Motion, Robot

BAND = 5.0
"""[Hz] that a diagnosis keeps of a torque. It takes 3 to 15 Hz, above which accelerations from the
encoders are noisier than the torque; of twelve arms of the corpus with their sensors, half are kept
to less than 5.2 Hz."""
_SPREAD = 5.0  # kinematics keep this many times that band, as in a diagnosis
_REVERSAL = 0.8  # periods of that band about a reversal whose direction of motion is uncertain


class ReadableRows:
    """Which part of the torques along a motion a diagnosis compares."""

    def __init__(self, robot: Robot, motion: Motion, band: float) -> None:
        """Find the rows to trust; all of them, and all frequencies, with an infinite band [Hz]."""
        time = motion.time
        self._weight = np.ones((len(motion.position), robot.transmission.size))
        self._gain: FloatArray | None = None
        if not np.isfinite(band) or time is None:
            return
        step = float(time[1] - time[0])
        frequency = np.fft.rfftfreq(2 * len(time), step)
        # Butterworth's filter of fourth order, forth and back.
        self._gain = np.asarray(1.0 / (1.0 + (frequency / band) ** 8), dtype=np.float64)
        self._weight = _trusted(robot, motion, 1.0 / (_SPREAD * band))

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


def _trusted(robot: Robot, motion: Motion, period: float) -> FloatArray:
    """Return (N, m): 0 where a joint that a gear moves turns round, 1 where it moves."""
    rows = robot.actuated
    speed = np.abs(motion.velocity[:, rows])
    acceleration = np.asarray(motion.acceleration)[:, rows]
    slow = _REVERSAL * period * np.sqrt(np.mean(acceleration**2, axis=0))
    slow = np.minimum(slow, 0.5 * np.sqrt(np.mean(speed**2, axis=0)))
    x = np.clip(2.0 * speed / np.where(slow > 0.0, slow, 1.0) - 1.0, 0.0, 1.0)
    each = np.where(slow > 0.0, x * x * (3.0 - 2.0 * x), 1.0)
    moves = np.abs(robot.transmission.topology) > 0.0
    return np.stack([each[:, moves[:, k]].min(axis=1) for k in range(rows.size)], axis=1)
