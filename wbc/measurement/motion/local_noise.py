"""How much of a channel no smooth motion explains: a lower bound of its noise."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.measurement.motion.local_polynomial import local_polynomial_operator

WINDOW_SAMPLES = 11
"""Samples that a local polynomial sees."""
_DEGREE = 4
_MAD_OF_GAUSSIAN = 0.674489750196
_MOST_ROWS = 50_000


def residual_noise(time: FloatArray, values: FloatArray) -> float:
    """Return the standard deviation of what a local polynomial leaves of a channel.

    A lower bound: noise that is slow against 11 samples, or that a filter of the drive has taken
    out, does not show. Robust against single steps (median absolute deviation), corrected for the
    degrees of freedom that the polynomial takes up.

    Args:
        time: (N,) [s].
        values: (N,).
    """
    if time.size < 2 * WINDOW_SAMPLES:
        return 0.0
    inner = unsmooth(time[:_MOST_ROWS], values[:_MOST_ROWS])[WINDOW_SAMPLES:-WINDOW_SAMPLES]
    robust = float(np.median(np.abs(inner)) / _MAD_OF_GAUSSIAN)
    # A coarse sensor stands still most of the time: half of the residuals vanish, not its noise.
    return robust if robust > 0.0 else float(np.std(inner))


def unsmooth(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return what a local polynomial leaves of each sample, as large as the noise in it.

    Args:
        time: (N,) [s], at least two windows.
        values: (N, ...).

    Returns:
        Same shape as the values, corrected for the degrees of freedom of the polynomial.
    """
    width = WINDOW_SAMPLES * float(np.median(np.diff(time)))
    smooth = local_polynomial_operator(time, width, _DEGREE)
    own = np.sqrt(np.maximum(1.0 - smooth.diagonal(), 0.05))
    return np.asarray(((values - smooth @ values).T / own).T)
