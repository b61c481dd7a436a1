"""Steps of links behind springs that dry friction holds, compiled: import it where it is needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Count, Matrix, Nothing, Number, compiled

_Cube = types.Array(types.float64, 3, "A", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")
_SWEEPS = 30
_SETTLED = 1e-9  # of the level


@compiled(Nothing, _Cube, _Cube, _Cube, *(Matrix, Matrix, Matrix), Number, Count, *(_OutCube,) * 3)
def follow_rubbing(
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    load: FloatArray,
    speed: FloatArray,
    level: FloatArray,
    step: float,
    parts: int,
    d: FloatArray,
    v: FloatArray,
    dry: FloatArray,
) -> None:
    """Write how n links behind springs move from S starts, with dry friction at the links.

    The trapezoidal rule for what is smooth. Friction is what would stop a link by the step's end,
    within its level; several links ask one another (Gauss-Seidel sweeps).

    Args:
        inertia, drag, pull: at the samples (N, n, n), springs and dampers included; straight lines
            between.
        load, speed, level: at the steps ((N - 1) parts + 1, n): torque of the links without
            deflection, speed of the motors, level of the friction.
        step: distance of the samples [s].
        parts: steps per sample.
        d, v: (N, n, S) to write, deflections and their rates. The first of each is given.
        dry: (N, n, S) to write, the mean of each interval; the last one stays.
    """
    n, starts = d.shape[1], d.shape[2]
    h = step / parts
    m, c, k = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    whole, gain = np.empty((n, n)), np.empty((n, n))
    new, rubs = np.empty(n), np.zeros((n, starts))
    at, rate = d[0].copy(), v[0].copy()
    for i in range(d.shape[0] - 1):
        for part in range(parts):
            share, now = (part + 0.5) / parts, i * parts + part
            for a in range(n):
                for b in range(n):
                    m[a, b] = (1.0 - share) * inertia[i, a, b] + share * inertia[i + 1, a, b]
                    c[a, b] = (1.0 - share) * drag[i, a, b] + share * drag[i + 1, a, b]
                    k[a, b] = (1.0 - share) * pull[i, a, b] + share * pull[i + 1, a, b]
                    whole[a, b] = m[a, b] + 0.5 * h * c[a, b] + 0.25 * h**2 * k[a, b]
                    gain[a, b] = 1.0 if a == b else 0.0
            # The inertia outweighs the rest at short steps: elimination needs no exchange of rows.
            for a in range(n):
                pivot = 1.0 / whole[a, a]
                for e in range(n):
                    whole[a, e] *= pivot
                    gain[a, e] *= pivot
                for b in range(n):
                    if b != a:
                        factor = whole[b, a]
                        for e in range(n):
                            whole[b, e] -= factor * whole[a, e]
                            gain[b, e] -= factor * gain[a, e]
            for s in range(starts):
                for a in range(n):
                    new[a] = 0.0
                for b in range(n):
                    push = -h * (0.5 * (load[now, b] + load[now + 1, b]) + rubs[b, s])
                    for e in range(n):
                        push += (m[b, e] - 0.5 * h * c[b, e] - 0.25 * h**2 * k[b, e]) * rate[e, s]
                        push -= h * k[b, e] * at[e, s]
                    for a in range(n):
                        new[a] += gain[a, b] * push
                for _ in range(_SWEEPS):
                    settled = True
                    for a in range(n):
                        most = level[now + 1, a]
                        wanted = rubs[a, s] + (new[a] + speed[now + 1, a]) / (h * gain[a, a])
                        wanted = min(max(wanted, -most), most)
                        change = wanted - rubs[a, s]
                        rubs[a, s] = wanted
                        settled = settled and abs(change) <= _SETTLED * most
                        for b in range(n):
                            new[b] -= h * gain[b, a] * change
                    if settled or n == 1:
                        break
                for a in range(n):
                    at[a, s] += 0.5 * h * (rate[a, s] + new[a])
                    rate[a, s] = new[a]
                    dry[i, a, s] += rubs[a, s] / parts
        for a in range(n):
            for s in range(starts):
                d[i + 1, a, s], v[i + 1, a, s] = at[a, s], rate[a, s]
