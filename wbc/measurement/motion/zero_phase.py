"""Low-pass without phase shift, and the derivatives of what it leaves, on jittered stamps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from wbc.arrays import FloatArray
from wbc.errors import LogError

_ORDER = 4


class Derivatives(NamedTuple):
    """A filtered signal and its first two derivatives, each (N,) or (N, n)."""

    value: FloatArray
    first: FloatArray
    second: FloatArray


def low_pass(time: FloatArray, values: FloatArray, cutoff: float) -> FloatArray:
    """Return a signal low-passed forward and backward (Butterworth, order 4 each way).

    The samples are put on an even grid of the median distance, filtered, and read off at their own
    stamps again. The same call on torque, velocity and position keeps them in step, which an
    identification needs more than a faithful amplitude.

    Args:
        time: (N,) [s], increasing.
        values: (N,) or (N, n).
        cutoff: frequency [Hz] at which half the amplitude is left (-6 dB for both passes).

    Raises:
        LogError: a cutoff that the sampling rate or the length of the log does not allow.
    """
    grid, even = _filtered(time, values, cutoff)
    return np.asarray(CubicSpline(grid, even, axis=0)(time))


def filtered_derivatives(time: FloatArray, values: FloatArray, cutoff: float) -> Derivatives:
    """Return a low-passed signal with its first and second derivative (see `low_pass`).

    The derivatives are those of the cubic spline through the filtered even samples.

    Raises:
        LogError: as for `low_pass`.
    """
    grid, even = _filtered(time, values, cutoff)
    spline = CubicSpline(grid, even, axis=0)
    return Derivatives(
        np.asarray(spline(time)), np.asarray(spline(time, 1)), np.asarray(spline(time, 2))
    )


def _filtered(time: FloatArray, values: FloatArray, cutoff: float) -> tuple[FloatArray, FloatArray]:
    """Return (even grid, filtered values on it)."""
    step = float(np.median(np.diff(time)))
    span = float(time[-1] - time[0])
    if not 1.0 / span < cutoff < 0.45 / step:
        raise LogError(
            f"a cutoff of {cutoff:g} Hz is outside what this log allows: {1.0 / span:.3g} Hz (one "
            f"over its length) to {0.45 / step:.4g} Hz (0.45 times its rate)."
        )
    count = round(span / step) + 1
    grid = np.linspace(time[0], time[-1], count)
    even = CubicSpline(time, values, axis=0)(grid)
    sections = butter(_ORDER, cutoff, fs=(count - 1) / span, output="sos")
    padding = min(count - 1, int(3.0 / (cutoff * step)))
    return grid, np.asarray(sosfiltfilt(sections, even, axis=0, padlen=padding))
