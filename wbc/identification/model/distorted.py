"""What filters and derivatives distort, and how far that can move a fitted number."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.model.fit import Fit

DISTORTED = 0.01
"""Share of the first error (rms) that filters and derivatives distort."""
ALIKE = 0.1
"""Share of that (rms) that may look like any one cause: no number of rows averages it away."""


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
