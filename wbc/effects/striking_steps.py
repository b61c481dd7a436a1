"""Steps of links that strike one another through gears with play, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Count, Matrix, Nothing, Number, OutDense, Vector, compiled

_Cube = types.Array(types.float64, 3, "A", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")
_SWEEPS = 30
_SETTLED = 1e-9  # of the level


@compiled(
    Nothing,
    *(_Cube, _Cube, _Cube),
    *(Matrix, Matrix, Matrix),
    *(Number, Count),
    *(Vector, Vector, Vector, Vector),
    *(OutDense, OutDense, OutDense),
)
def follow_striking(
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    load: FloatArray,
    speed: FloatArray,
    level: FloatArray,
    step: float,
    parts: int,
    late: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    half: FloatArray,
    d: FloatArray,
    v: FloatArray,
    dry: FloatArray,
) -> None:
    """Write how n links move together behind gears with play, from one start.

    Every step of the theta rule is linear in rates, deflections and loads; which flanks carry is
    decided in the middle of the step. Dry friction is what would stop a link by the step's end,
    within its level; several links ask one another (Gauss-Seidel sweeps).

    Args:
        inertia, drag, pull: of the links at the samples (N, n, n), without their gears.
        load, speed, level: torque of the links without deflection, speed of the motors, level of
            the links' dry friction (N, n).
        step: distance of the samples [s].
        parts: steps per sample.
        late: theta of each link, the weight of a step's end (n,).
        stiffness, damping, half: of the flanks, and half of the play (n,); none makes a spring.
        d, v: deflections and their rates (N, n) to write. The first of each is given.
        dry: (N, n) to write, the mean of each interval; the last one stays.
    """
    n = d.shape[1]
    h = step / parts
    whole, gain = np.empty((n, n)), np.empty((n, n))
    at, rate, new, right = d[0].copy(), v[0].copy(), np.empty(n), np.empty(n)
    rubs = np.zeros(n)
    for i in range(d.shape[0] - 1):
        for a in range(n):
            dry[i, a] = 0.0
        for part in range(parts):
            share = (part + 1.0) / parts
            for a in range(n):
                early = 1.0 - late[a]
                now = (part + late[a]) / parts
                total = -h * ((1.0 - now) * load[i, a] + now * load[i + 1, a])
                middle = at[a] + 0.5 * h * rate[a]
                for b in range(n):
                    m, c, k = inertia[i, a, b], drag[i, a, b], pull[i, a, b]
                    if a == b and abs(middle) >= half[a]:
                        c, k = c + damping[a], k + stiffness[a]
                        total += h * stiffness[a] * (half[a] if middle > 0.0 else -half[a])
                    whole[a, b] = m + h * late[a] * (c + h * late[b] * k)
                    by_rate = m - h * (early * c + h * late[a] * (1.0 - late[b]) * k)
                    total += by_rate * rate[b] - h * k * at[b]
                    gain[a, b] = 1.0 if a == b else 0.0
                right[a] = total
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
            for a in range(n):
                new[a] = 0.0
                for b in range(n):
                    new[a] += gain[a, b] * (right[b] - h * rubs[b])
            for _ in range(_SWEEPS):
                settled = True
                for a in range(n):
                    most = (1.0 - share) * level[i, a] + share * level[i + 1, a]
                    if most == 0.0 and rubs[a] == 0.0:
                        continue
                    motor = (1.0 - share) * speed[i, a] + share * speed[i + 1, a]
                    wanted = rubs[a] + (new[a] + motor) / (h * gain[a, a])
                    wanted = min(max(wanted, -most), most)
                    change = wanted - rubs[a]
                    rubs[a] = wanted
                    settled = settled and abs(change) <= _SETTLED * most
                    for b in range(n):
                        new[b] -= h * gain[b, a] * change
                if settled:
                    break
            for a in range(n):
                at[a] += h * ((1.0 - late[a]) * rate[a] + late[a] * new[a])
                rate[a] = new[a]
                dry[i, a] += rubs[a] / parts
        for a in range(n):
            d[i + 1, a], v[i + 1, a] = at[a], rate[a]


@compiled(
    Nothing,
    *(_Cube, _Cube, _Cube),
    *(Matrix, Matrix, Matrix, Matrix),
    *(Number, Count),
    *(Vector, Vector, Vector, Vector),
    *(_Cube, _OutCube),
)
def rank_striking(
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    load: FloatArray,
    speed: FloatArray,
    level: FloatArray,
    counted: FloatArray,
    step: float,
    parts: int,
    late: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    half: FloatArray,
    starts: FloatArray,
    torques: FloatArray,
) -> None:
    """Write the additional torque (N, n, B) at n links that begin in B ways.

    Args:
        inertia, drag, pull, load, speed, level: what drives the links, see `follow_striking`.
        counted: friction of the links without deflection (N, n).
        step: distance of the samples [s].
        parts: steps per sample.
        late, stiffness, damping, half: of the gears (n,).
        starts: (B, 2, n) deflections and rates.
        torques: (N, n, B) to write, accelerations taken over each interval; the last row stays.
    """
    samples, n = load.shape
    d, v, dry = np.empty((samples, n)), np.empty((samples, n)), np.empty((samples, n))
    for s in range(starts.shape[0]):
        for a in range(n):
            d[0, a], v[0, a] = starts[s, 0, a], starts[s, 1, a]
        follow_striking(
            inertia, drag, pull, load, speed, level, step, parts,
            late, stiffness, damping, half, d, v, dry,
        )  # fmt: skip
        for i in range(samples - 1):
            for a in range(n):
                total = dry[i, a] - counted[i, a]
                for b in range(n):
                    total += inertia[i, a, b] * (v[i + 1, b] - v[i, b]) / step
                    total += drag[i, a, b] * v[i, b] + pull[i, a, b] * d[i, b]
                torques[i, a, s] = total
