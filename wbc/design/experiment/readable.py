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
        self._trust: _Trust | None = None
        if not np.isfinite(band) or time is None:
            return
        step = float(time[1] - time[0])
        frequency = np.fft.rfftfreq(2 * len(time), step)
        # Butterworth's filter of fourth order, forth and back.
        self._gain = np.asarray(1.0 / (1.0 + (frequency / band) ** 8), dtype=np.float64)
        self._trust = _Trust(robot, motion, 1.0 / (SPREAD * band))
        self._weight = self._trust.weight

    def of(self, torque: FloatArray) -> FloatArray:
        """Return torques (N, m, ...) in the band, weighted by how far each row is trusted."""
        weight = self._weight.reshape(self._weight.shape + (1,) * (torque.ndim - 2))
        return np.asarray(weight * self._low(torque))

    def _low(self, torque: FloatArray) -> FloatArray:
        # Mirrored in time, so that there is no jump at the ends.
        both = np.concatenate([torque, torque[::-1]])
        return self._filtered(both)[: len(torque)]

    def _filtered(self, both: FloatArray) -> FloatArray:
        if self._gain is None:
            return both
        gain = self._gain.reshape(-1, *(1,) * (both.ndim - 1))
        return np.asarray(np.fft.irfft(gain * np.fft.rfft(both, axis=0), len(both), axis=0))

    def pull(self, slope: FloatArray) -> FloatArray:
        """Return slopes (N, m, ...) in torques, given those in what is read of them.

        The transpose of `of` at fixed weights.
        """
        weight = self._weight.reshape(self._weight.shape + (1,) * (slope.ndim - 2))
        late = np.concatenate([weight * slope, np.zeros_like(slope)])
        both, count = self._filtered(late), len(slope)
        # What was mirrored in time comes back mirrored; without a filter that part is zero.
        return np.asarray(both[:count] + both[: count - 1 : -1])

    def weight_pull(self, torque: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return slopes (N, m) in speeds and accelerations of joints, through the weights alone.

        Args:
            torque: (N, m, ...) that is read.
            slope: (N, m, ...) in what is read of it.
        """
        if self._trust is None:
            return np.zeros_like(self._weight), np.zeros_like(self._weight)
        each = slope * self._low(torque)
        return self._trust.pull(each.reshape(*self._weight.shape, -1).sum(axis=2))


class _Trust:
    """Weights (N, m): 0 where a joint that a gear moves turns round, 1 where it moves."""

    def __init__(self, robot: Robot, motion: Motion, period: float) -> None:
        rows = robot.actuated
        self._velocity = motion.velocity[:, rows]
        self._acceleration = np.asarray(motion.acceleration)[:, rows]
        self._lasting = REVERSAL * period * np.sqrt(np.mean(self._acceleration**2, axis=0))
        self._typical = 0.5 * np.sqrt(np.mean(self._velocity**2, axis=0))
        self._slow = np.minimum(self._lasting, self._typical)
        each = gate(self._velocity, self._slow)
        moves = np.abs(robot.transmission.topology) > 0.0
        joints = [np.flatnonzero(moves[:, k]) for k in range(rows.size)]
        # The joint whose reversal counts, per row and gear.
        self._least = np.stack([own[each[:, own].argmin(axis=1)] for own in joints], axis=1)
        self.weight = np.take_along_axis(each, self._least, axis=1)

    def pull(self, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return slopes (N, m) in velocities and accelerations, given those in the weights."""
        own = np.zeros_like(slope)
        for k, least in enumerate(self._least.T):
            np.add.at(own, (np.arange(len(least)), least), slope[:, k])
        slow = np.where(self._slow > 0.0, self._slow, np.inf)
        x = np.clip(2.0 * np.abs(self._velocity) / slow - 1.0, 0.0, 1.0)
        own *= 12.0 * x * (1.0 - x) / slow  # the slope of `gate`
        shrunk = -np.sum(own * np.abs(self._velocity) / slow, axis=0)
        # The slow speed is the smaller of two root mean squares.
        lasting = self._lasting < self._typical
        share = 1.0 / (len(slope) * slow)
        velocity = own * np.sign(self._velocity)
        velocity += np.where(lasting, 0.0, 0.25 * shrunk * share) * self._velocity
        reach = np.divide(
            self._lasting**2,
            np.mean(self._acceleration**2, axis=0),
            out=np.zeros_like(share),
            where=lasting,
        )
        return velocity, shrunk * share * reach * self._acceleration
