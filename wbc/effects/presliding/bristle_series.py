"""How bristles bend along a series, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Nothing, Number, OutRow, Row, compiled


@compiled(Nothing, Row, Number, OutRow)
def follow_bristles(position: FloatArray, length: float, bent: FloatArray) -> None:
    """Write z (N,) along positions (N,), from z = 0: exact where no interval holds a reversal."""
    z = 0.0
    for k in range(1, len(position)):
        way = position[k] - position[k - 1]
        end = np.sign(way)
        z = end + (z - end) * np.exp(-abs(way) / length)
        bent[k] = z
