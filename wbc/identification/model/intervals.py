"""How sure the parameters are: how much blocks of the logs differ, and what filters distort."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.fit import Fit

DISTORTED = 0.01
"""Share of the first error (rms) that filters and derivatives distort."""
ALIKE = 0.1
"""Share of that (rms) that may look like any one cause: no number of rows averages it away."""

# Neighbouring blocks still share some error: on the generated corpus (seed 11) 90 % intervals of
# refits on drawn blocks covered 76 %, those of a normal distribution 1.4 times as wide cover 90 %.
WIDER = 1.4
"""By which standard deviations over blocks are multiplied."""
TAIL = 1.645
"""Standard deviations from the middle to the ends of a normal distribution's 90 % interval."""


def alike_shifts(fit: Fit, first: FloatArray, noise: FloatArray) -> FloatArray:
    """Return (p,) the standard deviations of what looks like each parameter, in their scales.

    What is distorted at output o has the rms ALIKE DISTORTED first_o. In the worst direction it is
    the parameter's own column m once all others have taken up what they can of it:

        shift = sum_o w_o rms(m_o) ALIKE DISTORTED first_o / sum_o w_o rms(m_o)^2

    Args:
        fit: the fitted model.
        first: (outputs,) mean squares in floors of the robot as given.
        noise: (outputs,) mean square of what the fit leaves over independent samples per row.
    """
    count = len(fit.parameters)
    weights = 1.0 / noise
    a = (fit.jacobian * np.sqrt(weights)[:, None]).reshape(-1, count)
    usual = fit.usual.jacobian
    norm = np.sqrt(np.sum(a**2, axis=0) + np.sum(usual**2, axis=0))
    norm = np.where(norm > 0.0, norm, np.inf)
    gram = (a.T @ a + usual.T @ usual) / np.outer(norm, norm)
    known = np.linalg.pinv(gram, rcond=1e-9, hermitian=True)
    scale = np.diagonal(known)
    own = (fit.jacobian / norm) @ (known / np.where(scale > 0.0, scale, np.inf))
    size = np.sqrt(np.mean(own**2, axis=0))  # (outputs, p), per unit of the norm
    distorted = ALIKE * DISTORTED * np.sqrt(np.maximum(first - 1.0, 0.0))
    reach, power = (weights * distorted) @ size, weights @ size**2
    return np.asarray(np.where(power > 0.0, reach / np.maximum(power, 1e-300), 0.0) / norm)


def block_deviations(fit: Fit, blocks: IntArray) -> FloatArray:
    """Return (B, p) deviations A over blocks, in the parameters' scales; A' A is their covariance.

    Args:
        fit: the fitted model.
        blocks: (rows,) numbers of rows that stay together: residuals are autocorrelated.
    """
    if not fit.parameters:
        return np.zeros((0, 0))
    return WIDER * fit.steps_of_blocks(blocks)[1]


def interval_bounds(fit: Fit, blocks: IntArray, distortion: FloatArray) -> FloatArray:
    """Return (p, 2) the ends of the 90 % interval of every parameter, in its own unit.

    A parameter that the logs do not tell at all may be anything: its ends are those of its range.

    Args:
        fit: the fitted model.
        blocks: as of `block_deviations`.
        distortion: (p,) in units of the scales: how far the parameters move when the band of the
            filters is changed, a measure of what smoothing does to them.
    """
    half = np.hypot(TAIL * np.linalg.norm(block_deviations(fit, blocks), axis=0), distortion)
    bounds = np.empty((len(fit.parameters), 2))
    for row, (k, parameter) in enumerate(fit.parameters):
        value, reach = fit.effects[k].values[parameter.name], half[row] * parameter.scale
        told = np.any(fit.jacobian[:, :, row]) or np.any(fit.usual.jacobian[:, row])
        ends = (value - reach, value + reach) if told else (parameter.low, parameter.high)
        bounds[row] = np.clip(ends, parameter.low, parameter.high)
    return bounds
