"""What runs along a series, compiled: a filter both ways, and how bristles bend.

Import it where needed: loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.compiled import Dense, OutDense, Row, compiled

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
    rows = np.ascontiguousarray(positions).reshape(z.shape)
    _follow(rows, np.ravel(np.asarray(length, dtype=np.float64)), z)
    return z.reshape(positions.shape)


@compiled
def _follow(positions: Dense, length: Row, bent: OutDense) -> None:
    for i in range(positions.shape[1]):
        z = 0.0
        for k in range(1, len(positions)):
            way = positions[k, i] - positions[k - 1, i]
            end = np.sign(way)
            z = end + (z - end) * np.exp(-abs(way) / length[i])
            bent[k, i] = z


@compiled
def filter_both_ways(sections: Dense, steady: Dense, values: OutDense) -> None:
    """Filter columns (N, k) in place, forward and then backward.

    `scipy.signal.sosfilt` takes longer to begin than these short columns take to filter, and a
    model with links behind gears is filtered some hundred thousand times.

    Each pass begins as if its first value had lasted for ever.

    Args:
        sections: (s, 6) second-order sections as of `scipy.signal.butter`.
        steady: (s, 2) their states under a steady input of one, as of `scipy.signal.sosfilt_zi`.
        values: (N, k) to change.
    """
    rows, columns = values.shape
    begun, one, two = np.empty(columns), np.empty(columns), np.empty(columns)
    for backward in range(2):
        for k in range(columns):
            begun[k] = values[(rows - 1) * backward, k]
        for s in range(sections.shape[0]):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            for k in range(columns):
                one[k], two[k] = steady[s, 0] * begun[k], steady[s, 1] * begun[k]
            for i in range(rows):
                at = rows - 1 - i if backward else i
                for k in range(columns):
                    x = values[at, k]
                    y = b0 * x + one[k]
                    one[k] = b1 * x - a1 * y + two[k]
                    two[k] = b2 * x - a2 * y
                    values[at, k] = y
