"""How a measured velocity relates to the measured position: scale, delay, correlation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import FloatArray

_BLOCKS = 8
_BLOCK_ROWS = 40
_FILTER_SAMPLES = 2.0
_LONGEST_DELAY = 0.2


@dataclass(frozen=True)
class VelocityFit:
    """velocity(t) = scale dq/dt(t - delay), or the same through a first-order low-pass.

    Attributes:
        scale: 1 for a velocity that is the derivative of the position.
        delay: of the velocity behind the position [s], negative if it leads; the time constant of
            a low-pass is its delay at low frequency.
        delay_error: standard error of the delay [s], from the scatter between blocks of the log.
        correlation: between the position and the integral of the velocity, delay and trends taken
            out; its sign is that of the scale.
        filtered: whether a first-order low-pass explains the velocity better than a pure delay.
        moves: whether anything moves, so that the rest means something.
    """

    scale: float
    delay: float
    delay_error: float
    correlation: float
    filtered: bool
    moves: bool


def fit_velocity(time: FloatArray, position: FloatArray, velocity: FloatArray) -> VelocityFit:
    """Fit scale and delay by regression of the position on the integral of the velocity.

    A low-pass T dv/dt + v = k dq/dt gives q = (1/k) (int v dt + T v) + constant without error, a
    delay d = T the same for a delay that is short against the motion. Regressing q on
    (int v, v, t, 1) gives both numbers without differentiating noise, on jittered stamps, finer
    than a sample; the term in t takes up an offset of the velocity. Which of the two it is, the
    residuals tell; below two samples they are the same.

    Args:
        time: (N,) [s].
        position: (N,), continuous (wraps removed).
        velocity: (N,).
    """
    integral = cumulative_trapezoid(velocity, time, initial=0.0)
    whole = _regress(time, position, velocity, integral)
    if whole is None:
        return VelocityFit(1.0, 0.0, np.inf, 0.0, filtered=False, moves=False)
    inverse, lag, correlation, residual = whole
    size = max(_BLOCK_ROWS, time.size // _BLOCKS)
    pieces = [slice(k, k + size) for k in range(0, time.size - size + 1, size)]
    delays = [
        part[1]
        for rows in pieces
        if (part := _regress(time[rows], position[rows], velocity[rows], integral[rows]))
        and part[2] > 0.9
    ]
    spread = np.inf
    if len(delays) >= 3:
        lag = float(np.median(delays))
        spread = float(1.4826 * np.median(np.abs(np.array(delays) - lag)) / np.sqrt(len(delays)))
    filtered = False
    if lag > _FILTER_SAMPLES * float(np.median(np.diff(time))):
        shifted = np.interp(time + lag, time, integral)
        inside = time + lag <= time[-1]
        filtered = residual < 0.5 * _misfit(time[inside], position[inside], shifted[inside])
    return VelocityFit(1.0 / inverse, lag, spread, correlation, filtered, moves=True)


def _detrended(time: FloatArray, signals: FloatArray) -> FloatArray:
    """Return signals (N, n) without their best straight lines."""
    basis, _ = np.linalg.qr(np.stack([np.ones_like(time), time - time.mean()], axis=1))
    return np.asarray(signals - basis @ (basis.T @ signals))


def _misfit(time: FloatArray, position: FloatArray, shifted: FloatArray) -> float:
    """Return the rms residual of a position against one signal, straight lines removed."""
    if time.size < _BLOCK_ROWS:
        return 0.0
    q, s = _detrended(time, np.stack([position, shifted], axis=1)).T
    return float(np.sqrt(np.mean((q - s * (s @ q) / (s @ s)) ** 2)))


def _regress(
    time: FloatArray, position: FloatArray, velocity: FloatArray, integral: FloatArray
) -> tuple[float, float, float, float] | None:
    """Return (1/k, delay, correlation, rms residual), None where nothing moves."""
    q, s, v = _detrended(time, np.stack([position, integral, velocity], axis=1)).T
    if min(float(np.mean(x**2)) for x in (q, s, v)) <= 1e-24:
        return None
    gram = np.array([[s @ s, s @ v], [s @ v, v @ v]])
    if np.linalg.det(gram) <= 1e-10 * gram[0, 0] * gram[1, 1]:
        return None
    a, b = np.linalg.solve(gram, np.array([s @ q, v @ q]))
    rest = q - a * s - b * v
    correlation = np.sign(a) * np.sqrt(max(0.0, 1.0 - (rest @ rest) / (q @ q)))
    if abs(b) > _LONGEST_DELAY * (time[-1] - time[0]) * abs(a):
        # No delay, but a channel that resembles the position itself.
        return 1.0, 0.0, float((s @ q) / np.sqrt((s @ s) * (q @ q))), 0.0
    return float(a), float(b / a), float(correlation), float(np.sqrt(np.mean(rest**2)))
