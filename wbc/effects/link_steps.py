"""Steps of links that dry friction holds or flanks strike, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Count, Dense, Matrix, Nothing, Number, OutDense, Vector, compiled

_Cube = types.Array(types.float64, 3, "A", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")
_OutRow = types.Array(types.float64, 1, "C")
_SWEEPS = 30
_SETTLED = 1e-9  # of the level


@compiled(Nothing, OutDense, OutDense)
def _invert(whole: FloatArray, inverse: FloatArray) -> None:
    """Write the inverse of `whole` (n, n), which is used up.

    The inertia outweighs the rest at short steps: elimination needs no exchange of rows.
    """
    n = whole.shape[0]
    inverse[:] = 0.0
    for a in range(n):
        inverse[a, a] = 1.0
    for a in range(n):
        pivot = 1.0 / whole[a, a]
        for e in range(n):
            whole[a, e] *= pivot
            inverse[a, e] *= pivot
        for b in range(n):
            if b != a:
                factor = whole[b, a]
                for e in range(n):
                    whole[b, e] -= factor * whole[a, e]
                    inverse[b, e] -= factor * inverse[a, e]


@compiled(Nothing, _OutRow, _OutRow, Vector, Vector, Dense, Number)
def _rub(
    rate: FloatArray,
    rubs: FloatArray,
    speed: FloatArray,
    level: FloatArray,
    gain: FloatArray,
    step: float,
) -> None:
    """Change the rates (n,) of links at a step's end, and the friction (n,) that they have had.

    Friction is what would stop a link by the step's end, within its level; several links ask one
    another (Gauss-Seidel sweeps).

    Args:
        rate: with the friction `rubs`.
        rubs: friction of the step.
        speed, level: of the motors and of the friction at the step's end (n,).
        gain: rates per torque impulse (n, n).
        step: [s].
    """
    n = rate.size
    for _ in range(_SWEEPS):
        settled = True
        for a in range(n):
            if level[a] == 0.0 and rubs[a] == 0.0:
                continue
            wanted = rubs[a] + (rate[a] + speed[a]) / (step * gain[a, a])
            wanted = min(max(wanted, -level[a]), level[a])
            change = wanted - rubs[a]
            rubs[a] = wanted
            settled = settled and abs(change) <= _SETTLED * level[a]
            for b in range(n):
                rate[b] -= step * gain[b, a] * change
        if settled or n == 1:
            break


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

    The trapezoidal rule for what is smooth; friction as in `_rub`.

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
    new, rubs = np.empty(n), np.zeros((starts, n))
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
            _invert(whole, gain)
            for s in range(starts):
                for a in range(n):
                    new[a] = 0.0
                for b in range(n):
                    push = -h * (0.5 * (load[now, b] + load[now + 1, b]) + rubs[s, b])
                    for e in range(n):
                        push += (m[b, e] - 0.5 * h * c[b, e] - 0.25 * h**2 * k[b, e]) * rate[e, s]
                        push -= h * k[b, e] * at[e, s]
                    for a in range(n):
                        new[a] += gain[a, b] * push
                _rub(new, rubs[s], speed[now + 1], level[now + 1], gain, h)
                for a in range(n):
                    at[a, s] += 0.5 * h * (rate[a, s] + new[a])
                    rate[a, s] = new[a]
                    dry[i, a, s] += rubs[s, a] / parts
        for a in range(n):
            for s in range(starts):
                d[i + 1, a, s], v[i + 1, a, s] = at[a, s], rate[a, s]


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
    decided in the middle of the step. Dry friction as in `_rub`.

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
    rubs, motor, most, rough = np.zeros(n), np.empty(n), np.empty(n), False
    for i in range(level.shape[0]):
        for a in range(n):
            rough = rough or level[i, a] > 0.0
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
                right[a] = total
            _invert(whole, gain)
            for a in range(n):
                new[a] = 0.0
                for b in range(n):
                    new[a] += gain[a, b] * (right[b] - h * rubs[b])
            if rough:
                for a in range(n):
                    motor[a] = (1.0 - share) * speed[i, a] + share * speed[i + 1, a]
                    most[a] = (1.0 - share) * level[i, a] + share * level[i + 1, a]
                _rub(new, rubs, motor, most, gain, h)
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
