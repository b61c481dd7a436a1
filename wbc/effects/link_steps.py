"""Steps of links that swing behind their gears, compiled: import it where it is needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Count, Matrix, Nothing, Number, Vector, compiled

_Cube = types.Array(types.float64, 3, "A", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")
_OutRow = types.Array(types.float64, 1, "C")


@compiled(
    Nothing,
    *(Vector, Vector, Vector, Vector, Vector, Vector),
    *(Number, Count, Number, Number, Number, Number, Number, Number),
    *(_OutRow, _OutRow, _OutRow),
)
def follow_loose(
    load: FloatArray,
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    speed: FloatArray,
    level: FloatArray,
    step: float,
    parts: int,
    late: float,
    stiffness: float,
    damping: float,
    half: float,
    d: float,
    v: float,
    positions: FloatArray,
    rates: FloatArray,
    frictions: FloatArray,
) -> None:
    """Write the deflection and its rate (N,) of a link with play, from one start.

    On a flank and between, a step of the theta rule is linear in rate, deflection and load. Dry
    friction is what would stop the link by the step's end, within its level.

    Args:
        load, inertia, drag, pull: what drives the link (N,).
        speed, level: of the motor, and of the link's dry friction (N,).
        step: distance of the samples [s].
        parts: steps per sample.
        late: theta, the weight of a step's end.
        stiffness, damping, half: of the flanks, and half of the play.
        d, v: the start.
        positions, rates: (N,) to write.
        frictions: (N,) to write, the mean of each interval; the last one stays.
    """
    h = step / parts
    early = 1.0 - late
    for i in range(load.size):
        positions[i], rates[i] = d, v
        if i == load.size - 1:
            return
        frictions[i] = 0.0
        rubs = level[i] > 0.0 or level[i + 1] > 0.0
        slope = (load[i + 1] - load[i]) / parts
        free = 1.0 / (inertia[i] + h * late * (drag[i] + h * late * pull[i]))
        b, p = drag[i] + damping, pull[i] + stiffness
        held = 1.0 / (inertia[i] + h * late * (b + h * late * p))
        for part in range(parts):
            torque = load[i] + slope * (part + 1 - early)
            middle = d + 0.5 * h * v
            if abs(middle) > half:
                rest = stiffness * (half if middle > half else -half)
                new = (
                    (inertia[i] - h * early * (b + h * late * p)) * v - h * (p * d + torque - rest)
                ) * held
            else:
                by_rate = inertia[i] - h * early * (drag[i] + h * late * pull[i])
                new = (by_rate * v - h * (pull[i] * d + torque)) * free
            if rubs:
                share = (part + 1.0) / parts
                most = (1.0 - share) * level[i] + share * level[i + 1]
                given = h * (held if abs(middle) > half else free)
                link = new + (1.0 - share) * speed[i] + share * speed[i + 1]
                dry = min(max(link / given, -most), most)
                new -= given * dry
                frictions[i] += dry / parts
            d += h * (early * v + late * new)
            v = new


@compiled(
    Nothing,
    *(Vector, Vector, Vector, Vector, Vector, Vector),
    *(Number, Count, Vector, Vector, Vector, Vector),
    *(_Cube, _OutCube),
)
def rank_loose(
    load: FloatArray,
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    speed: FloatArray,
    level: FloatArray,
    step: float,
    parts: int,
    late: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    half: FloatArray,
    starts: FloatArray,
    torques: FloatArray,
) -> None:
    """Write the additional torque (N, P, S) of P contacts (P,) from S starts each.

    Args:
        load, inertia, drag, pull, speed, level: what drives the link (N,), see `follow_loose`.
        step: distance of the samples [s].
        parts: steps per sample.
        late, stiffness, damping, half: of the contacts (P,).
        starts: (P, S, 2) deflections and rates.
        torques: (N, P, S) to write; the last row stays.
    """
    positions, rates, dry = np.empty(load.size), np.empty(load.size), np.empty(load.size)
    for i in range(starts.shape[0]):
        for j in range(starts.shape[1]):
            follow_loose(
                load, inertia, drag, pull, speed, level, step, parts,
                late[i], stiffness[i], damping[i], half[i], starts[i, j, 0], starts[i, j, 1],
                positions, rates, dry,
            )  # fmt: skip
            for k in range(load.size - 1):
                torque = inertia[k] * (rates[k + 1] - rates[k]) / step
                torque += drag[k] * rates[k] + pull[k] * positions[k]
                torques[k, i, j] = torque + dry[k]


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
