"""Zero-phase smoothing, differentiation, and how much white noise a channel carries."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.signal import butter, sosfilt_zi, welch

from wbc.arrays import FloatArray

_ORDER = 2
_ROUNDING = 1e-9  # of the range of a channel, below which a difference is one of rounding
_SLOWEST = 10.0  # [Hz]: steps crossed more rarely are still taken for noise of this bandwidth


def low_pass(values: FloatArray, cutoff: float, rate: float, order: int = _ORDER) -> FloatArray:
    """Return `values` (N, ...) low-passed forward and backward (no phase shift).

    Args:
        values: samples along the first axis.
        cutoff: [Hz] of each of the two passes of a Butterworth filter.
        rate: [Hz] sampling rate; a cutoff at or above half of it leaves the values unchanged.
        order: of each pass.
    """
    if cutoff >= 0.5 * rate or len(values) < 4 or not values.size:
        return values
    padding = min(len(values) - 1, int(3.0 * rate / cutoff))
    before = 2.0 * values[0] - values[padding:0:-1]
    after = 2.0 * values[-1] - values[-2 : -padding - 2 : -1]
    from wbc.identification.records.filters.filter_loop import (
        filter_both_ways,  # loads the compiler
    )

    longer = np.concatenate([before, values, after]).reshape(-1, values[0].size)
    filter_both_ways(*_sections(cutoff / (0.5 * rate), order), longer)
    return longer[padding : padding + len(values)].reshape(values.shape)


@lru_cache(maxsize=64)
def _sections(relative: float, order: int) -> tuple[FloatArray, FloatArray]:
    """Return a Butterworth filter's sections and their state under a steady input of one."""
    sections = butter(order, relative, output="sos")
    return np.asarray(sections), np.asarray(sosfilt_zi(sections))


def white_level(values: FloatArray, rate: float) -> FloatArray:
    """Return the one-sided power density of the white noise in each column, (n,) [unit^2/Hz].

    The level is read in the upper part of the band, where a moving robot has no motion left; a
    sensor that filters its own noise makes it a lower bound. A column that was not measured (NaN)
    has the level NaN.

    Args:
        values: (N, n) samples.
        rate: [Hz].
    """
    length = min(len(values), 1024)
    measured = np.isfinite(values).all(axis=0)
    result = np.full(values.shape[1], np.nan)
    if not measured.any():
        return result
    values = values[:, measured]
    frequency, power = welch(values, rate, window="hann", nperseg=length, detrend="linear", axis=0)
    upper = (frequency > 0.3 * rate) & (frequency < 0.48 * rate)
    # The median of a chi-square variable with few degrees of freedom lies below its mean.
    segments = max(1, 2 * len(values) // length - 1)
    degrees = 2.0 * max(1.0, 0.75 * segments)
    bias = (1.0 - 2.0 / (9.0 * degrees)) ** 3
    result[measured] = np.median(power[upper], axis=0) / bias
    return result


def quantisation_level(values: FloatArray, rate: float) -> FloatArray:
    """Return the one-sided power density of the quantisation error of each column, (n,).

    The error of a resolution step is uniform, step^2 / 12, and is spread over the rate at which
    steps are crossed: slow motion gathers it at the low frequencies that a robot's torque lives in.
    Zero for a column without steps.

    Args:
        values: (N, n) samples.
        rate: [Hz].
    """
    result = np.zeros(values.shape[1])
    for column, samples in enumerate(values.T):
        moves = np.abs(np.diff(samples))
        moves = moves[moves > _ROUNDING * max(float(np.ptp(samples)), 1e-300)]
        if not moves.size or not np.isfinite(moves).all():
            continue
        step = float(moves.min())
        parts = moves / step
        if np.mean(np.abs(parts - np.round(parts)) < 0.1) < 0.95:
            continue
        crossings = float(np.sum(parts)) / (len(samples) / rate)
        result[column] = step**2 / 12.0 * 2.0 / np.clip(crossings, _SLOWEST, rate)
    return result


def derivative(values: FloatArray, rate: float) -> FloatArray:
    """Return the time derivative of `values` (N, ...) by fourth-order central differences.

    Second-order ones shrink a 5 Hz acceleration sampled at 500 Hz by a thousandth, which shows in
    an inertia; the first and last two samples are of second order.

    Args:
        values: samples along the first axis.
        rate: [Hz].
    """
    result = np.gradient(values, 1.0 / rate, axis=0)
    if len(values) > 4:
        inner = 8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
        result[2:-2] = inner * (rate / 12.0)
    return np.asarray(result)


def differentiate(positions: FloatArray, rate: float, model: pin.Model) -> FloatArray:
    """Return the velocity (N, nv) of configurations (N, nq) by central differences.

    Args:
        positions: pinocchio's configurations, already smoothed.
        rate: [Hz].
        model: gives the difference on joints whose configuration is no vector (free-flyer).
    """
    if model.nq == model.nv:
        return derivative(positions, rate)
    steps = np.array([pin.difference(model, a, b) for a, b in pairwise(positions)])
    inner = 0.5 * (steps[:-1] + steps[1:])
    return np.concatenate([steps[:1], inner, steps[-1:]]) * rate


def gate(value: FloatArray, threshold: FloatArray) -> FloatArray:
    """Return a smooth weight: 0 for |value| < threshold / 2, 1 above `threshold`."""
    floor = np.where(threshold > 0.0, threshold, 1.0)
    x = np.clip(2.0 * np.abs(value) / floor - 1.0, 0.0, 1.0)
    weight = x * x * (3.0 - 2.0 * x)
    return np.asarray(np.where(threshold > 0.0, weight, 1.0))
