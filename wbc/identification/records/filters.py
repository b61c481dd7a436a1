"""Which frequencies of a log can be trusted: noise of its sensors, cut-offs, smooth weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import welch, windows

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.measurement.filters import WINDOW_SAMPLES, low_pass, unsmooth
from wbc.robot import Robot

LOWEST = 3.0
"""Band of what is judged [Hz], unless a log is too slow for it."""
_HIGHEST = 15.0
OF_RATE = 0.1
"""Share of the slowest sampling rate, above which nothing is judged."""
_MOVES = 4.0  # times the noise of the smoothed speed
SPREAD = 5.0  # kinematics keep this many times the residual's band, so that reversals stay sharp
_ROUNDING = 1e-9  # of the range of a channel, below which a difference is one of rounding
_SLOWEST = 10.0  # [Hz]: steps crossed more rarely are still taken for noise of this bandwidth
_SEGMENT, _LONG = 1024, 8.0  # samples of a spectrum; [s] where low frequencies are looked at
_UPPER, _HALF = (0.3, 0.48), (0.15, 0.24)  # of the rate: where noise is read, and an octave below
# Times by which the power falls between the two where a low-pass left nothing there. The channels
# of a recorded arm that was low-passed fall by 110, what a Hann window leaks, or more; the torques,
# positions and velocities of 12 other recorded machines and 120 generated logs by at most 12.
_FILTERED = 35.0
_STEP = 0.25  # [octaves] between the frequencies at which a spectrum is read, over twice as many
# Share of the slope of the three steps above from which on it is flat: behind filters of order 2
# and 4, forward and backward, slopes scatter by 0.8 to 1.4, and the first step in what passed has
# 0.1 to 0.6 of them.
_FLAT = 0.65


@dataclass(frozen=True)
class NoiseDensity:
    """One-sided power densities of the white noise of the sensors [unit^2/Hz].

    Attributes:
        position: (nv,), of single-axis joints and of the base, in its own frame; NaN elsewhere.
        velocity: (nv,).
        torque: (m,), at the motor output side.
        forces: contact name -> (3,).
        sensed: (s,), of the torque sensors behind gears.
        passed: (m,) [Hz] up to which low-passes let the torques pass, infinite without any.
    """

    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    forces: Mapping[str, FloatArray]
    sensed: FloatArray
    passed: FloatArray

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


_NOTHING = np.zeros(0)
UNKNOWN = NoiseDensity(_NOTHING, _NOTHING, _NOTHING, {}, _NOTHING, _NOTHING)
"""Noise that was not measured yet."""
WHOLE = Bandwidth(np.inf, np.inf)
"""The band of what is not filtered yet."""


def choose_bandwidth(
    noises: Sequence[NoiseDensity], inertia: FloatArray, actuated: IntArray, rate: float
) -> Bandwidth:
    """Return the band in which differentiated positions are no noisier than the torque sensor.

    Above the frequency where inertia times acceleration noise exceeds the torque noise, a wider
    band adds noise faster than information. Beyond what low-passes let pass of all torques there is
    nothing.

    Args:
        noises: of every log.
        inertia: (m,) a typical inertia [kg m^2] seen by each motor output.
        actuated: (m,) rows of the driven joints in v.
        rate: [Hz], the slowest of the logs.
    """
    best = min(_HIGHEST, max(float(noise.passed.max()) for noise in noises))
    for noise, cutoff in product(noises, np.geomspace(0.5, 0.2 * rate, 80).tolist()):
        acceleration = np.fmin(*noise.acceleration_variance(cutoff))[actuated]
        if np.any(inertia**2 * acceleration > noise.torque * cutoff):
            best = min(best, 0.65 * cutoff)
    residual = float(np.clip(best, LOWEST, min(_HIGHEST, OF_RATE * rate)))
    return Bandwidth(residual, min(SPREAD * residual, 0.2 * rate))


def white_level(values: FloatArray, rate: float) -> FloatArray:
    """Return the one-sided power density of the white noise in each column, (n,) [unit^2/Hz].

    The level is read in the upper part of the band, where a moving robot has no motion left; a
    sensor that filters its own noise makes it a lower bound. A column that was not measured (NaN)
    has the level NaN.

    Args:
        values: (N, n) samples.
        rate: [Hz].
    """
    measured = np.isfinite(values).all(axis=0)
    result = np.full(values.shape[1], np.nan)
    if measured.any():
        frequency, power = _spectrum(values[:, measured], rate, _SEGMENT)
        result[measured] = _between(frequency, power, *(share * rate for share in _UPPER))
    return result


def low_passed(values: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return up to which frequency [Hz] a low-pass let columns pass, and their density there, (n,).

    No white noise is more than that density. From above, it is the first frequency where the
    spectrum falls more slowly than where the filter takes everything away. Infinite and zero where
    the upper part of the band holds noise, as it does unless somebody filtered it away.

    Args:
        values: (N, n) samples.
        rate: [Hz].
    """
    last, density = np.full(values.shape[1], np.inf), np.zeros(values.shape[1])
    if not values.size:
        return last, density
    spectrum = _spectrum(values, rate, max(_SEGMENT, int(_LONG * rate)), steep=True)
    half, upper = (_between(*spectrum, low * rate, high * rate) for low, high in (_HALF, _UPPER))
    # A digital low-pass is steeper than its order near half the rate.
    most, lowest = _HALF[0] * rate, spectrum[0][1]
    edges = most * 2.0 ** -np.arange(0.0, np.log2(most / lowest), _STEP)
    levels = np.array([_between(*spectrum, *ends) for ends in zip(edges[2:], edges, strict=False)])
    rounded = 2.0 * (_ROUNDING * np.ptp(values, axis=0)) ** 2 / rate
    for column in np.flatnonzero((half > _FILTERED * upper) | (upper < rounded)):
        start = int(np.argmax(levels[:, column] > rounded[column]))
        level = np.log(np.maximum(levels[start:, column], 1e-300))
        falls = level[2:] - level[:-2]
        flat = (k for k in range(2, falls.size) if falls[k] < _FLAT * np.median(falls[:k][-6:]))
        first = 2 + next(flat, falls.size - 1)
        last[column], density[column] = edges[start + first], np.exp(level[first])
    return last, density


def _between(frequency: FloatArray, power: FloatArray, low: float, high: float) -> FloatArray:
    """Return the level (n,) of a spectrum between two frequencies, or at the one nearest them."""
    inside = (frequency > low) & (frequency < high)
    inside[np.abs(frequency - 0.5 * (low + high)).argmin()] |= not inside.any()
    return np.asarray(np.median(power[inside], axis=0))


def _spectrum(
    values: FloatArray, rate: float, segment: int, *, steep: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (F,) [Hz] and power densities (F, n), whose medians are the true ones.

    By Welch's method; `steep` for a window that leaks less far away.
    """
    length = min(len(values), segment)
    window = windows.hann(length, sym=False) ** (2 if steep else 1)
    frequency, power = welch(values, rate, window=window, detrend="linear", axis=0)
    # The median of a chi-square variable with few degrees of freedom lies below its mean.
    segments = max(1, 2 * len(values) // length - 1)
    degrees = 2.0 * max(1.0, 0.75 * segments)
    return frequency, power / (1.0 - 2.0 / (9.0 * degrees)) ** 3


def steady_level(values: FloatArray, direction: FloatArray, rate: float) -> FloatArray:
    """Return the density of the noise of each column while a direction lasts, (n,) [unit^2/Hz].

    Dry friction jumps where a joint turns round, and a spectrum of the whole column holds its jumps
    at all frequencies. On 426 torque channels of generated logs this level is 0.89 to 1.05 times
    the true one (rms); that of the spectrum is up to 12 times as large. Infinite where no direction
    lasts.

    Args:
        values: (N, n) samples.
        direction: (N, n) of what moves behind each, -1, 0 or 1.
        rate: [Hz].
    """
    if len(values) < 2 * WINDOW_SAMPLES:
        return np.full(values.shape[1], np.inf)
    left = unsmooth(np.arange(len(values)) / rate, values) ** 2
    turned = np.zeros(values.shape, dtype=bool)
    turned[1:] = np.diff(direction, axis=0) != 0.0
    far = ~maximum_filter1d(turned, 2 * WINDOW_SAMPLES + 1, axis=0, mode="constant")
    far[:WINDOW_SAMPLES] = far[-WINDOW_SAMPLES:] = False
    count = np.sum(far, axis=0)
    level = np.sum(left * far, axis=0) / np.maximum(count, 1) * 2.0 / rate
    return np.where(count >= 2 * WINDOW_SAMPLES, level, np.inf)


def quantisation_level(values: FloatArray, rate: float) -> FloatArray:
    """Return the one-sided power density of the quantisation error of each column, (n,).

    The error of a resolution step is uniform, step^2 / 12, and is spread over the rate at which
    steps are crossed: slow motion gathers it at the low frequencies that a robot's torque lives in.
    Zero for a column without steps.

    Args:
        values: (N, n) samples.
        rate: [Hz].
    """
    moves = np.abs(np.diff(values, axis=0))
    least = _ROUNDING * np.maximum(np.ptp(values, axis=0), 1e-300)
    moves = np.where(moves > least, moves, np.nan)
    step = np.fmin.reduce(moves, axis=0)
    parts = moves / step
    count, whole = np.sum(parts > 0.0, axis=0), np.abs(parts - np.round(parts)) < 0.1
    crossings = np.nansum(parts, axis=0) / (len(values) / rate)
    level = step**2 / 12.0 * 2.0 / np.clip(crossings, _SLOWEST, rate)
    return np.where((count > 0) & (np.sum(whole, axis=0) >= 0.95 * count), level, 0.0)


def smoothed(
    robot: Robot, position: FloatArray, cutoff: float, rate: float, order: int = 2
) -> FloatArray:
    """Return q (N, nq) of a robot low-passed as by `low_pass`; the base keeps unit quaternions."""
    result = low_pass(position, cutoff, rate, order)
    if robot.has_free_flyer:
        result[:, 3:7] /= np.linalg.norm(result[:, 3:7], axis=1, keepdims=True)
    return result


def gate(value: FloatArray, threshold: FloatArray) -> FloatArray:
    """Return a smooth weight: 0 for |value| < threshold / 2, 1 above `threshold`."""
    floor = np.where(threshold > 0.0, threshold, 1.0)
    x = np.clip(2.0 * np.abs(value) / floor - 1.0, 0.0, 1.0)
    weight = x * x * (3.0 - 2.0 * x)
    return np.asarray(np.where(threshold > 0.0, weight, 1.0))
