"""Held-out residuals where numbers are drawn to what is usual: what is still open of them counts.

A fold that is left out may be the only one that tells some of the drawn numbers. What the others
then predict is off by as much as the prior leaves open, which a prediction with one value for
each number takes for a miss. So the drawn numbers are integrated over; numbers without a prior
keep their one value: they have to repeat themselves from fold to fold.
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.fit import Fit


def beside_drawn(fit: Fit, folds: IntArray) -> tuple[FloatArray, float]:
    """Return (rows, outputs) held-out squares beside what is open, and what that costs [nats].

    With r the held-out residual of a fold, W its weights, J its derivatives by the drawn numbers
    and A what all folds and the prior know of them, the log density of r is

        -1/2 r' (W - W J A^-1 J' W) r  +  1/2 log det(A - J' W J)  -  1/2 log det A  + const

    (Woodbury). Where nothing is drawn, these are the held-out squares, and no cost.

    Args:
        fit: of all records.
        folds: (rows,) number of the fold of every row.
    """
    held = fit.held_out_residual(folds)
    drawn = np.any(fit.usual.jacobian, axis=0)
    if fit.failed or not drawn.any():
        return held**2, 0.0
    weights = fit.usual.weights
    a = fit.jacobian[:, :, drawn] * weights[:, None]
    count = int(drawn.sum())
    usual = fit.usual.jacobian[:, drawn]
    known = a.reshape(-1, count).T @ a.reshape(-1, count) + usual.T @ usual
    squares, cost = np.empty_like(held), 0.0
    for fold in np.unique(folds):
        inside = folds == fold
        own = a[inside].reshape(-1, count)
        moment = own.T @ (held[inside] * weights).ravel()
        open_part = a[inside] @ np.linalg.solve(known, moment) / weights
        squares[inside] = held[inside] * (held[inside] - open_part)
        cost += 0.5 * (_log_det(known) - _log_det(known - own.T @ own))
    return squares, cost


def _log_det(matrix: FloatArray) -> float:
    return float(np.linalg.slogdet(matrix)[1])
