"""How bristles bend along a series, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.compiled import Matrix, OutMatrix, Vector, compiled


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
