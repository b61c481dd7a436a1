"""How bristles bend along a series, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.compiled import Matrix, OutMatrix, Vector, compiled

_SHARES = (0.01, 0.05, 0.2)  # of the travel


def memories(positions: FloatArray) -> list[FloatArray]:
    """Return how bristles bend along positions (N,) or (N, k), for lengths of 1, 5 and 20 %."""
    travel = np.ptp(positions, axis=0)
    return [bent_along(positions, share * np.where(travel > 0.0, travel, 1.0)) for share in _SHARES]


def bent_along(positions: FloatArray, length: ArrayLike) -> FloatArray:
    """Return z (N,) or (N, k) along positions (N,) or (N, k), from z = 0.

    Exact where no interval holds a reversal.
    """
    z = np.zeros((len(positions), np.size(length)))
    _follow(positions.reshape(z.shape), np.ravel(np.asarray(length, dtype=np.float64)), z)
    return z.reshape(positions.shape)


@compiled
def _follow(positions: Matrix, length: Vector, bent: OutMatrix) -> None:
    for i in range(positions.shape[1]):
        z = 0.0
        for k in range(1, len(positions)):
            way = positions[k, i] - positions[k - 1, i]
            end = np.sign(way)
            z = end + (z - end) * np.exp(-abs(way) / length[i])
            bent[k, i] = z
