"""Which frequencies of a log can be trusted: cut-offs from the noise of its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray

_LOWEST, _HIGHEST = 3.0, 15.0
_MOVES = 4.0  # times the noise of the smoothed speed
_SPREAD = 5.0  # kinematics keep this many times the residual's band, so that reversals stay sharp


@dataclass(frozen=True)
class NoiseDensity:
    """One-sided power densities of the white noise of the sensors [unit^2/Hz].

    Attributes:
        position: (nv,), of single-axis joints and of the base, in its own frame; NaN elsewhere.
        velocity: (nv,).
        torque: (m,), at the motor output side.
        forces: contact name -> (3,).
        sensed: (s,), of the torque sensors behind gears.
    """

    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    forces: Mapping[str, FloatArray] = field(default_factory=dict)
    sensed: FloatArray = field(default_factory=lambda: np.zeros(0))

    def acceleration_variance(self, cutoff: float) -> tuple[FloatArray, FloatArray]:
        """Return the variance (nv,) of accelerations up to `cutoff` from position, velocity."""
        turn = 2.0 * np.pi
        from_position = turn**4 * self.position * cutoff**5 / 5.0
        from_velocity = turn**2 * self.velocity * cutoff**3 / 3.0
        return from_position, from_velocity

    def measures_speed(self, band: Bandwidth) -> BoolArray:
        """Return whose (nv,) velocity sensor gives a quieter acceleration than its position."""
        by_position, by_velocity = self.acceleration_variance(band.residual)
        return np.asarray(by_velocity < np.where(np.isfinite(by_position), by_position, np.inf))

    def speed_deviation(self, band: Bandwidth) -> FloatArray:
        """Return the standard deviation (nv,) of smoothed velocities [rad/s, m/s].

        They come from the sensor that `measures_speed` says, quieter at these frequencies or not.
        """
        cutoff = band.kinematics
        from_position = (2.0 * np.pi) ** 2 * self.position * cutoff**3 / 3.0
        variance = np.where(self.measures_speed(band), self.velocity * cutoff, from_position)
        return np.asarray(np.sqrt(np.nan_to_num(variance)))

    def moving(self, velocity: FloatArray, band: Bandwidth) -> BoolArray:
        """Return whose (nv,) smoothed velocity (N, nv) is more than noise on the whole."""
        speed = np.sqrt(np.mean(velocity**2, axis=0))
        return np.asarray(speed > _MOVES * self.speed_deviation(band))


@dataclass(frozen=True)
class Bandwidth:
    """Cut-offs [Hz].

    Attributes:
        residual: of the residual and of every regressor.
        kinematics: of positions and velocities before the model is evaluated.
    """

    residual: float
    kinematics: float


def choose_bandwidth(
    noises: Sequence[NoiseDensity], inertia: FloatArray, actuated: IntArray, rate: float
) -> Bandwidth:
    """Return the band in which differentiated positions are no noisier than the torque sensor.

    Above the frequency where inertia times acceleration noise exceeds the torque noise, a wider
    band adds noise faster than information.

    Args:
        noises: of every log.
        inertia: (m,) a typical inertia [kg m^2] seen by each motor output.
        actuated: (m,) rows of the driven joints in v.
        rate: [Hz], the slowest of the logs.
    """
    best = _HIGHEST
    for noise in noises:
        candidates = np.geomspace(0.5, 0.2 * rate, 80)
        for cutoff in candidates:
            by_position, by_velocity = noise.acceleration_variance(float(cutoff))
            acceleration = np.fmin(by_position, by_velocity)[actuated]
            if np.any(inertia**2 * acceleration > noise.torque * cutoff):
                best = min(best, 0.65 * float(cutoff))
                break
    residual = float(np.clip(best, _LOWEST, min(_HIGHEST, 0.1 * rate)))
    return Bandwidth(residual, min(_SPREAD * residual, 0.2 * rate))
