"""How a measured velocity relates to the measured position: scale, delay, correlation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import FloatArray

_BLOCKS = 8
_BLOCK_ROWS = 40


@dataclass(frozen=True)
class VelocityFit:
    """velocity(t) = scale dq/dt(t - delay).

    Attributes:
        scale: 1 for a velocity that is the derivative of the position.
        delay: of the velocity behind the position [s]; negative if it leads.
        delay_error: standard error of the delay [s], from the scatter between blocks of the log.
        correlation: between the position and the integral of the velocity, trends removed.
        moves: whether the motion is far enough above the resolution for any of this to count.
    """

    scale: float
    delay: float
    delay_error: float
    correlation: float
    moves: bool


def fit_velocity(time: FloatArray, position: FloatArray, velocity: FloatArray) -> VelocityFit:
    """Fit scale and delay by regression of the position on the integral of the velocity.

    If v(t) = k q'(t - d) then, for a delay short against the motion,
    q = (1/k) (int v dt + d v) + constant; regressing q on (int v, v, t, 1) gives both without
    differentiating noise, on jittered time stamps, finer than a sample. The term in t takes up an
    offset of the velocity.

    Args:
        time: (N,) [s].
        position: (N,), continuous (wraps removed).
        velocity: (N,).
    """
    integral = cumulative_trapezoid(velocity, time, initial=0.0)
    whole = _regress(time, position, velocity, integral)
    if whole is None:
        return VelocityFit(1.0, 0.0, np.inf, 0.0, moves=False)
    inverse, lag, correlation = whole
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
    moves = bool(np.ptp(position) > 0.0 and abs(inverse) > 0.0)
    return VelocityFit(1.0 / inverse if moves else 1.0, lag, spread, correlation, moves)


def _regress(
    time: FloatArray, position: FloatArray, velocity: FloatArray, integral: FloatArray
) -> tuple[float, float, float] | None:
    """Return (1/k, delay, correlation), None where nothing moves."""
    drift = np.stack([np.ones_like(time), time - time.mean()], axis=1)
    basis, _ = np.linalg.qr(drift)
    signals = np.stack([position, integral, velocity], axis=1)
    q, s, v = (signals - basis @ (basis.T @ signals)).T
    scale_q, scale_s, scale_v = (float(np.sqrt(np.mean(x**2))) for x in (q, s, v))
    if min(scale_q, scale_s, scale_v) <= 1e-12:
        return None
    gram = np.array([[s @ s, s @ v], [s @ v, v @ v]])
    if np.linalg.det(gram) <= 1e-10 * gram[0, 0] * gram[1, 1]:
        return None
    a, b = np.linalg.solve(gram, np.array([s @ q, v @ q]))
    correlation = float((s @ q) / np.sqrt((s @ s) * (q @ q)))
    return (float(a), float(b / a), correlation) if a != 0.0 else None
