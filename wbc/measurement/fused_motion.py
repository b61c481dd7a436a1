"""Position, velocity and acceleration of one motion from both sensors at once."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded

from wbc.arrays import FloatArray
from wbc.errors import LogError

_DEGREE = 5
_KNOTS_PER_PERIOD = 8.0


class FusedMotion(NamedTuple):
    """One smooth motion: the velocity is the derivative of the position, and so on; (N, n)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def fuse_motion(
    time: FloatArray,
    position: FloatArray,
    cutoff: float,
    *,
    position_noise: float,
    velocity: FloatArray | None = None,
    velocity_noise: float = 1.0,
) -> FusedMotion:
    """Return the smoothest motion through measured positions and velocities.

    The quintic spline q(t) minimises, on the true time stamps,

        sum_i (q - q_i)^2 / s_q^2 + sum_i (dq/dt - v_i)^2 / s_v^2 + L int (d3q/dt3)^2 dt.

    The gain of the whole smoother is one half at `cutoff`: with w = 2 pi cutoff and N samples in a
    time T, L = (N / T) (1 / s_q^2 + w^2 / s_v^2) / w^6. There is no phase shift, jitter does no
    harm, and the cost grows linearly with N.

    Args:
        time: (N,) [s], increasing.
        position: (N, n) or (N,).
        cutoff: [Hz].
        position_noise: s_q, standard deviation; without velocities only a scale.
        velocity: like `position`, None without; a delay must be taken out before
            (`align_velocity`).
        velocity_noise: s_v, standard deviation.

    Raises:
        LogError: a cutoff that rate or length do not allow, or a noise that is not positive.
    """
    span = float(time[-1] - time[0])
    rate = (time.size - 1) / span
    if not 1.0 / span < cutoff < 0.45 * rate:
        raise LogError(
            f"a cutoff of {cutoff:g} Hz is outside what this log allows: {1.0 / span:.3g} Hz to "
            f"{0.45 * rate:.4g} Hz."
        )
    if not (position_noise > 0.0 and velocity_noise > 0.0):
        raise LogError("the noise of position and velocity must be above 0.")
    omega = 2.0 * pi * cutoff
    knots = _knots(time, min(_KNOTS_PER_PERIOD * cutoff, rate))
    value, slope, bend = (_design(time, knots, k) for k in range(3))
    normal = (value.T @ value) / position_noise**2
    right = value.T @ position / position_noise**2
    weight = 1.0 / position_noise**2
    if velocity is not None:
        normal = normal + (slope.T @ slope) / velocity_noise**2
        right = right + slope.T @ velocity / velocity_noise**2
        weight += omega**2 / velocity_noise**2
    normal = normal + (rate * weight / omega**6) * _jerk_penalty(knots)
    coefficients = _solve_banded(normal, right)
    return FusedMotion(value @ coefficients, slope @ coefficients, bend @ coefficients)


def _knots(time: FloatArray, density: float) -> FloatArray:
    """Return even knots, `density` per second, repeated at the ends."""
    count = max(2, int(np.ceil((time[-1] - time[0]) * density)) + 1)
    inner = np.linspace(time[0], time[-1], count)
    return np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])


def _design(time: FloatArray, knots: FloatArray, derivative: int) -> sparse.csr_array:
    """Return the matrix (N, m) that takes spline coefficients to a derivative at `time`."""
    lower = knots[derivative : knots.size - derivative]
    matrix = BSpline.design_matrix(time, lower, _DEGREE - derivative)
    for k in range(derivative, 0, -1):
        matrix = matrix @ _difference(knots[k - 1 : knots.size - k + 1], _DEGREE - k + 1)
    return sparse.csr_array(matrix)


def _difference(knots: FloatArray, degree: int) -> sparse.csr_array:
    """Return the matrix from coefficients of a spline to those of its derivative (de Boor)."""
    count = knots.size - degree - 1
    inverse = degree / (knots[degree + 1 : degree + count] - knots[1:count])
    return sparse.diags_array(
        [-inverse, inverse], offsets=[0, 1], shape=(count - 1, count), format="csr"
    )


def _jerk_penalty(knots: FloatArray) -> sparse.csr_array:
    """Return P with c' P c = int (d3q/dt3)^2 dt, exact by Gauss' rule on every interval."""
    edges = np.unique(knots)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    half = 0.5 * np.diff(edges)
    points = (edges[:-1] + half)[:, None] + half[:, None] * nodes
    third = _design(points.ravel(), knots, 3)
    measure = sparse.diags_array((half[:, None] * weights).ravel())
    return sparse.csr_array(third.T @ measure @ third)


def _solve_banded(matrix: sparse.csr_array, right: FloatArray) -> FloatArray:
    """Solve a symmetric positive definite system of half-bandwidth `_DEGREE`."""
    bands = np.zeros((_DEGREE + 1, matrix.shape[0]))
    for k in range(_DEGREE + 1):
        bands[k, : matrix.shape[0] - k] = matrix.diagonal(k)
    try:
        return np.asarray(solveh_banded(bands, right, lower=True))
    except np.linalg.LinAlgError as cause:
        raise LogError(
            "the samples do not determine a smooth motion: there are gaps longer than the cutoff "
            "can bridge; cut the log there (log.between)."
        ) from cause
