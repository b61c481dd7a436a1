"""Smoothing and differentiation by local polynomials on the real time stamps (Savitzky-Golay)."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import sparse

from wbc.arrays import FloatArray
from wbc.errors import LogError

_ROWS_AT_ONCE = 16_384


def local_polynomial_operator(
    time: FloatArray, width: float, degree: int = 3, derivative: int = 0
) -> sparse.csr_array:
    """Return the banded operator A (N, N) with (A y)(t_i) = d^k y/dt^k of a local fit.

    At every time stamp a polynomial is fitted to the samples around it by weighted least squares
    (tricube weights) on the true, possibly jittered stamps; A acts on any number of channels at
    once (A @ Y with Y (N, n)). At the ends the window turns one-sided. The classic uniform case is
    Savitzky & Golay, Analytical Chemistry 36 (1964); the weights are Cleveland's, JASA 74 (1979).

    Args:
        time: (N,) [s], increasing.
        width: full width of the window [s].
        degree: of the polynomial.
        derivative: k, at most the degree.

    Raises:
        LogError: a window that holds too few samples for the degree, or more than there are.
    """
    if not 0 <= derivative <= degree:
        raise LogError(f"derivative {derivative} does not exist for a polynomial of {degree}.")
    size = round(width / float(np.median(np.diff(time)))) | 1
    if size < degree + 2 or size > time.size:
        shortest = (degree + 2) * float(np.median(np.diff(time)))
        raise LogError(
            f"a window of {width:g} s holds {size} of {time.size} samples; a polynomial of degree "
            f"{degree} needs at least {shortest:.3g} s and at most {time[-1] - time[0]:.3g} s."
        )
    first = np.clip(np.arange(time.size) - size // 2, 0, time.size - size)
    windows = sliding_window_view(time, size)
    weights = np.empty((time.size, size))
    for start in range(0, time.size, _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        offsets = windows[first[rows]] - time[rows, None]
        weights[rows] = _weights(offsets, degree, derivative)
    columns = first[:, None] + np.arange(size)
    pointers = np.arange(0, time.size * size + 1, size)
    shape = (time.size, time.size)
    return sparse.csr_array((weights.ravel(), columns.ravel(), pointers), shape=shape)


def _weights(offsets: FloatArray, degree: int, derivative: int) -> FloatArray:
    """Return for each window (rows of `offsets`) the weights of its samples, same shape."""
    reach = np.abs(offsets).max(axis=1, keepdims=True)
    scaled = offsets / reach
    kernel = (1.0 - (0.999 * np.abs(scaled)) ** 3) ** 3
    powers = scaled[:, :, None] ** np.arange(degree + 1)
    weighted = powers * kernel[:, :, None]
    normal = np.einsum("rsp,rsq->rpq", weighted, powers)
    unit = np.zeros((1, degree + 1, 1))
    unit[0, derivative, 0] = factorial(derivative)
    combination = np.linalg.solve(normal, np.broadcast_to(unit, (*normal.shape[:2], 1)))
    values = np.einsum("rsp,rp->rs", weighted, combination[:, :, 0])
    return np.asarray(values / reach**derivative)
