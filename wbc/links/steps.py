"""Steps of links behind gears that yield, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

import numpy as np
from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Count, Dense, Nothing, Number, OutDense, Places, compiled
from wbc.transmission.flank_steps import flank_impulse

_Cube = types.Array(types.float64, 3, "C", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")
_Row = types.Array(types.float64, 1, "C", readonly=True)
_OutRow = types.Array(types.float64, 1, "C")
_SWEEPS = 30
_SETTLED = 1e-9  # of the level
_NEWTON = 8  # rounds, after which flanks count with their largest slope: slow, but always nearer
_ROUNDS = 40
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


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


@compiled(Nothing, _OutRow, _OutRow, _Row, _Row, Dense, Number)
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


@compiled(
    Nothing,
    *(_Cube, _Cube, _Cube),
    *(Dense, Dense, Dense),
    *(Number, Count),
    *(_Row, _Row, _Row, _Row, Number),
    *(Places, _Cube, _Cube),
    *(_OutCube, _OutCube, _OutCube, _OutCube, _OutCube),
)
def follow_links(
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
    farthest: float,
    first: IntArray,
    begun: FloatArray,
    rates: FloatArray,
    d: FloatArray,
    v: FloatArray,
    dry: FloatArray,
    ended: FloatArray,
    last: FloatArray,
) -> None:
    """Write how n links move together behind their gears, S times, in each of W windows anew.

    Every step of the theta rule is linear in rates, deflections and loads, with the matrices of
    the middle of the step, but for the flanks: `flank_impulse`, solved by Newton's method, which
    takes one round unless a flank is reached or let go. Dry friction as in `_rub`. What strays
    farther than `farthest` is not followed: from there on all is infinite.

    Args:
        inertia, drag, pull: of the links at the samples (N, n, n), without their gears; straight
            lines between.
        load: torque of the links without deflection at the steps ((N - 1) parts + 1, n).
        speed, level: speed of the motors, level of the links' dry friction at the samples (N, n).
        step: distance of the samples [s].
        parts: steps per sample.
        late: theta of each link, the weight of a step's end (n,).
        stiffness, damping, half: of the flanks, and half of the play (n,); none makes a spring.
        farthest: [rad].
        first: number of the first sample of each window (W,), from 0 on.
        begun, rates: deflections and their rates (W, n, S) with which the windows begin.
        d, v: deflections and their rates (N, n, S) to write.
        dry: (N, n, S) to write, the mean of each interval; the last one stays.
        ended, last: deflections and rates (W, n, S) to write, at the ends of the windows.
    """
    n, starts = d.shape[1], d.shape[2]
    h = step / parts
    m, whole, gain = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    by_rate, by_place, push = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    at, rate = np.empty((starts, n)), np.empty((starts, n))
    new, right, rubs = np.empty(n), np.empty(n), np.zeros((starts, n))
    motor, most, lost = np.empty(n), np.empty(n), np.zeros(starts)
    carried, slope, whole_slope = np.empty(n), np.empty(n), np.empty(n)
    rough, window = False, 0
    for a in range(n):
        whole_slope[a] = h * late[a] * (h * late[a] * stiffness[a] + damping[a])
    for i in range(level.shape[0]):
        for a in range(n):
            rough = rough or level[i, a] > 0.0
    for i in range(d.shape[0] - 1):
        if window < first.size and first[window] == i:
            for s in range(starts):
                lost[s] = 0.0
                for a in range(n):
                    at[s, a], rate[s, a] = begun[window, a, s], rates[window, a, s]
                    rubs[s, a] = 0.0
                    d[i, a, s], v[i, a, s] = at[s, a], rate[s, a]
            window += 1
        for part in range(parts):
            middle, end, now = (part + 0.5) / parts, (part + 1.0) / parts, i * parts + part
            for a in range(n):
                early = 1.0 - late[a]
                push[a] = h * (early * load[now, a] + late[a] * load[now + 1, a])
                motor[a] = (1.0 - end) * speed[i, a] + end * speed[i + 1, a]
                most[a] = (1.0 - end) * level[i, a] + end * level[i + 1, a]
                for b in range(n):
                    inert = (1.0 - middle) * inertia[i, a, b] + middle * inertia[i + 1, a, b]
                    c = (1.0 - middle) * drag[i, a, b] + middle * drag[i + 1, a, b]
                    k = (1.0 - middle) * pull[i, a, b] + middle * pull[i + 1, a, b]
                    m[a, b] = inert + h * late[a] * (c + h * late[b] * k)
                    by_rate[a, b] = inert - h * (early * c + h * late[a] * (1.0 - late[b]) * k)
                    by_place[a, b] = h * k
            known = -1  # pattern of the flanks that `gain` is for
            for s in range(starts):
                if lost[s] > 0.0:
                    continue
                for a in range(n):
                    new[a] = rate[s, a]
                for turn in range(_ROUNDS):
                    pattern = 0  # of the flanks that carry throughout; -1 where one is crossed
                    for a in range(n):
                        carried[a], slope[a], touch, _ = flank_impulse(
                            stiffness[a], damping[a], half[a], h, late[a], late[a],
                            at[s, a], rate[s, a], new[a],
                        )  # fmt: skip
                        if turn >= _NEWTON:
                            touch = 1.0
                        if touch == 1.0:
                            slope[a] = whole_slope[a]
                        if pattern >= 0 and touch == 1.0:
                            pattern += 1 << a
                        elif touch > 0.0:
                            pattern = -1
                        carried[a] -= slope[a] * new[a]
                    if pattern < 0 or pattern != known:
                        known = pattern
                        for a in range(n):
                            for b in range(n):
                                whole[a, b] = m[a, b]
                            whole[a, a] += slope[a]
                        _invert(whole, gain)
                    for a in range(n):
                        total = -push[a] - h * rubs[s, a] - carried[a]
                        for b in range(n):
                            total += by_rate[a, b] * rate[s, b] - by_place[a, b] * at[s, b]
                        right[a] = total
                    for a in range(n):
                        new[a] = 0.0
                        for b in range(n):
                            new[a] += gain[a, b] * right[b]
                    if rough:
                        _rub(new, rubs[s], motor, most, gain, h)
                    met = True
                    for a in range(n):
                        if half[a] > 0.0:
                            passed, _, _, _ = flank_impulse(
                                stiffness[a], damping[a], half[a], h, late[a], late[a],
                                at[s, a], rate[s, a], new[a],
                            )  # fmt: skip
                            off = abs(passed - carried[a] - slope[a] * new[a])
                            size = m[a, a] * (abs(new[a]) + abs(rate[s, a]))
                            met = met and off <= _MET * (size + abs(passed))
                    if met:
                        break
                for a in range(n):
                    at[s, a] += h * ((1.0 - late[a]) * rate[s, a] + late[a] * new[a])
                    rate[s, a] = new[a]
                    dry[i, a, s] += rubs[s, a] / parts
                    if not abs(at[s, a]) < farthest:
                        lost[s] = 1.0
        for s in range(starts):
            for a in range(n):
                d[i + 1, a, s] = np.inf if lost[s] > 0.0 else at[s, a]
                v[i + 1, a, s] = np.inf if lost[s] > 0.0 else rate[s, a]
                ended[window - 1, a, s], last[window - 1, a, s] = d[i + 1, a, s], v[i + 1, a, s]
