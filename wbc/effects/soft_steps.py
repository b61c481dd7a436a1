"""Steps of links that swing behind springs, compiled: import it where it is needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Count, Matrix, Nothing, Number, compiled

_Cube = types.Array(types.float64, 3, "A", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")


@compiled(Nothing, _Cube, _Cube, _Cube, Matrix, Number, Count, _OutCube)
def follow_soft(
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    load: FloatArray,
    step: float,
    parts: int,
    d: FloatArray,
) -> None:
    """Write the deflections of n links behind springs, from rest and from unit starts.

    Newmark's rule with average acceleration, which takes no energy out of a swing.

    Args:
        inertia, drag, pull: at the samples (N, n, n), springs and dampers included; straight lines
            between.
        load: at the steps ((N - 1) parts + 1, n).
        step: distance of the samples [s].
        parts: steps per sample.
        d: ((N - 1) parts + 1, n, 1 + 2 n) to write. The first two steps are given.
    """
    n, count = d.shape[1], d.shape[2]
    h = step / parts
    m, c, k = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    right = np.empty((n, count))
    for i in range(1, d.shape[0] - 1):
        below = min(i // parts, inertia.shape[0] - 2)
        share = i / parts - below
        for a in range(n):
            for b in range(n):
                m[a, b] = (1.0 - share) * inertia[below, a, b] + share * inertia[below + 1, a, b]
                c[a, b] = (1.0 - share) * drag[below, a, b] + share * drag[below + 1, a, b]
                k[a, b] = (1.0 - share) * pull[below, a, b] + share * pull[below + 1, a, b]
        for a in range(n):
            for s in range(count):
                total = 0.0
                for b in range(n):
                    inert, damped, held = m[a, b] / h**2, c[a, b] / (2.0 * h), k[a, b] / 4.0
                    total += (2.0 * inert - 2.0 * held) * d[i, b, s]
                    total -= (inert - damped + held) * d[i - 1, b, s]
                right[a, s] = total
            right[a, 0] -= (load[i + 1, a] + 2.0 * load[i, a] + load[i - 1, a]) / 4.0
        for a in range(n):
            for b in range(n):
                m[a, b] = m[a, b] / h**2 + c[a, b] / (2.0 * h) + k[a, b] / 4.0
        # The inertia outweighs the rest at short steps: elimination needs no exchange of rows.
        for a in range(n):
            for b in range(a + 1, n):
                factor = m[b, a] / m[a, a]
                for e in range(a, n):
                    m[b, e] -= factor * m[a, e]
                for s in range(count):
                    right[b, s] -= factor * right[a, s]
        for a in range(n - 1, -1, -1):
            for s in range(count):
                total = right[a, s]
                for b in range(a + 1, n):
                    total -= m[a, b] * d[i + 1, b, s]
                d[i + 1, a, s] = total / m[a, a]
