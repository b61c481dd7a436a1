"""Motions as Fourier series under a window, at rest at both ends (Swevers et al. 1997)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DesignError

_RAMP = 0.1  # share of the duration over which the window opens, and closes


@dataclass(frozen=True, eq=False)
class FourierPath:
    """q(t) = center + w(t) sum_k [s_k sin(k omega t) + c_k cos(k omega t)] of every driven joint.

    The window w rises from 0 to 1 and falls back with continuous second derivative, so that the
    robot starts and ends at rest in `center`.

    Attributes:
        center: (m,) [rad, m].
        sine, cosine: (m, K) [rad, m].
        frequency: of the first harmonic [Hz].
        duration: [s].
    """

    center: FloatArray
    sine: FloatArray
    cosine: FloatArray
    frequency: float
    duration: float

    def __post_init__(self) -> None:
        """Check sizes."""
        if self.sine.shape != self.cosine.shape or len(self.sine) != len(self.center):
            raise DesignError("a path needs as many sines as cosines, one row per joint.")
        if not (self.frequency > 0.0 and self.duration > 0.0):
            raise DesignError("frequency and duration of a path must be > 0.")

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations (N, m) at times (N,) [s]."""
        order = 2.0 * np.pi * self.frequency * np.arange(1, self.sine.shape[1] + 1)
        angle = time[:, None] * order
        sin, cos = np.sin(angle), np.cos(angle)
        wave = sin @ self.sine.T + cos @ self.cosine.T
        rate = (cos * order) @ self.sine.T - (sin * order) @ self.cosine.T
        bend = -(sin * order**2) @ self.sine.T - (cos * order**2) @ self.cosine.T
        w, w1, w2 = (part[:, None] for part in self._window(time))
        position = self.center + w * wave
        return position, w * rate + w1 * wave, w * bend + 2.0 * w1 * rate + w2 * wave

    def scaled(self, share: float | FloatArray) -> FourierPath:
        """Return the path with all amplitudes multiplied by `share`, one or one per joint (m,)."""
        rows = np.broadcast_to(share, self.center.shape)[:, None]
        return FourierPath(
            self.center, rows * self.sine, rows * self.cosine, self.frequency, self.duration
        )

    def times(self, rate: float) -> FloatArray:
        """Return the times (N,) [s] of samples at `rate` [Hz], both ends included."""
        return np.arange(round(self.duration * rate) + 1) / rate

    def _window(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the window and its two derivatives (N,): a quintic step up and down."""
        ramp = _RAMP * self.duration
        rising = time <= 0.5 * self.duration
        s = np.clip(np.where(rising, time, self.duration - time) / ramp, 0.0, 1.0)
        sign = np.where(rising, 1.0, -1.0)
        w = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        w1 = sign * 30.0 * s**2 * (1.0 - s) ** 2 / ramp
        w2 = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / ramp**2
        return w, w1, w2
