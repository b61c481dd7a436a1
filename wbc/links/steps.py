"""Steps of links behind gears that yield, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Places,
    Row,
    compiled,
    group,
)
from wbc.structures import Structure
from wbc.transmission.flank_steps import flank_impulse

_Cube = types.Array(types.float64, 3, "C", readonly=True)
_OutCube = types.Array(types.float64, 3, "C")
_SWEEPS = 30
_SETTLED = 1e-9  # of the level
_NEWTON = 8  # rounds, after which flanks count with their largest slope: slow, but always nearer
_ROUNDS = 40
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


LINKS = Structure(
    "Links",
    **dict.fromkeys(("inertia", "drag", "pull"), _Cube),
    **dict.fromkeys(("load", "speed", "level", "gears"), Dense),
    first=Places,
    **dict.fromkeys(("begun", "rates"), _Cube),
    **dict.fromkeys(("d", "v", "dry", "ended", "last"), _OutCube),
    parts=Count,
)
"""Links behind their gears along a log, in windows.

Arrays:
    inertia, drag, pull: of the links at the samples (N, n, n), without their gears; straight lines
        between.
    load: torque of the links without deflection at the steps ((N - 1) parts + 1, n).
    speed, level: speed of the motors, level of the links' dry friction at the samples (N, n).
    gears: (n, 4) at STIFFNESS, DAMPING, HALF, half of the play, none of which makes a spring, and
        LATE, theta, the weight of a step's end.
    first: number of the first sample of each window (W,), from 0 on.
    begun, rates: deflections and their rates (W, n, S) with which the windows begin.
    d, v: deflections and their rates (N, n, S) to write.
    dry: friction (N, n, S) to write, the mean of each interval; the last one stays.
    ended, last: deflections and rates (W, n, S) to write, at the ends of the windows.
    parts: steps per sample.
"""

STIFFNESS, DAMPING, HALF, LATE = range(4)


class LinkStep(NamedTuple):
    """Memory for one step of n links.

    Attributes:
        inertia, by_rate, by_place, gain: (n, n) impulse per rate at the end, at the start, per
            deflection; and rates per impulse, with the flanks.
        push: (n,) impulse of the loads.
        motor, level: (n,) speed of the motors, level of dry friction at the end.
        carried, slope: (n,) impulse of the flanks at rest, and its change per rate.
    """

    inertia: FloatArray
    by_rate: FloatArray
    by_place: FloatArray
    gain: FloatArray
    push: FloatArray
    motor: FloatArray
    level: FloatArray
    carried: FloatArray
    slope: FloatArray


_STEP = group(LinkStep, *(OutDense,) * 4, *(OutRow,) * 5)


@compiled(Nothing, OutDense, OutDense, counted=False)
def invert(whole: FloatArray, inverse: FloatArray) -> None:
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


@compiled(Nothing, OutRow, OutRow, _STEP, Number, counted=False)
def rub(rate: FloatArray, rubs: FloatArray, at: LinkStep, h: float) -> None:
    """Change the rates (n,) of links at a step's end, and the friction (n,) that they have had.

    Friction is what would stop a link by the step's end, within its level; several links ask one
    another (Gauss-Seidel sweeps).

    Args:
        rate: with the friction `rubs`.
        rubs: friction of the step.
        at: the step.
        h: [s].
    """
    n, level, gain = rate.size, at.level, at.gain
    for _ in range(_SWEEPS):
        settled = True
        for a in range(n):
            if level[a] == 0.0 and rubs[a] == 0.0:
                continue
            wanted = rubs[a] + (rate[a] + at.motor[a]) / (h * gain[a, a])
            wanted = min(max(wanted, -level[a]), level[a])
            change = wanted - rubs[a]
            rubs[a] = wanted
            settled = settled and abs(change) <= _SETTLED * level[a]
            for b in range(n):
                rate[b] -= h * gain[b, a] * change
        if settled or n == 1:
            break


@compiled(Nothing, LINKS.kind, Count, Count, Number, _STEP, counted=False)
def place_step(links: Any, i: int, part: int, h: float, at: LinkStep) -> None:
    """Write a step of h [s], a `part` of the interval that begins with sample i."""
    middle, end, now = (
        (part + 0.5) / links.parts,
        (part + 1.0) / links.parts,
        i * links.parts + part,
    )
    n = len(at.push)
    for a in range(n):
        late = links.gears[a, LATE]
        early = 1.0 - late
        at.push[a] = h * (early * links.load[now, a] + late * links.load[now + 1, a])
        at.motor[a] = (1.0 - end) * links.speed[i, a] + end * links.speed[i + 1, a]
        at.level[a] = (1.0 - end) * links.level[i, a] + end * links.level[i + 1, a]
        for b in range(n):
            m = (1.0 - middle) * links.inertia[i, a, b] + middle * links.inertia[i + 1, a, b]
            c = (1.0 - middle) * links.drag[i, a, b] + middle * links.drag[i + 1, a, b]
            k = (1.0 - middle) * links.pull[i, a, b] + middle * links.pull[i + 1, a, b]
            other = links.gears[b, LATE]
            at.inertia[a, b] = m + h * late * (c + h * other * k)
            at.by_rate[a, b] = m - h * (early * c + h * late * (1.0 - other) * k)
            at.by_place[a, b] = h * k


@compiled(Count, Dense, Number, Row, Row, Row, Flag, _STEP, counted=False)
def lean(
    gears: FloatArray,
    h: float,
    place: FloatArray,
    rate: FloatArray,
    new: FloatArray,
    steepest: bool,
    at: LinkStep,
) -> int:
    """Write what flanks carry near the rates `new` (n,) of a step's end.

    Args:
        gears: (n, 4), see LINKS.
        h: [s].
        place, rate, new: (n,) deflections, their rates, and rates at the end.
        steepest: whether flanks count with their largest slope.
        at: the step.

    Returns:
        the flanks that carry throughout, as a number; -1 where one is crossed.
    """
    pattern = 0
    for a in range(len(new)):
        k, c, half, late = gears[a, STIFFNESS], gears[a, DAMPING], gears[a, HALF], gears[a, LATE]
        carried, slope, touch, _ = flank_impulse(
            k, c, half, h, late, late, place[a], rate[a], new[a]
        )
        if steepest or touch == 1.0:
            touch, slope = 1.0, h * late * (h * late * k + c)
        if pattern >= 0 and touch == 1.0:
            pattern += 1 << a
        elif touch > 0.0:
            pattern = -1
        at.carried[a], at.slope[a] = carried - slope * new[a], slope
    return pattern


@compiled(Flag, Dense, Number, Row, Row, Row, _STEP, counted=False)
def meets(
    gears: FloatArray, h: float, place: FloatArray, rate: FloatArray, new: FloatArray, at: LinkStep
) -> bool:
    """Return whether flanks pass at `new` (n,) what the step took them to; others as of `lean`."""
    for a in range(len(new)):
        k, c, half, late = gears[a, STIFFNESS], gears[a, DAMPING], gears[a, HALF], gears[a, LATE]
        if half > 0.0:
            passed, _, _, _ = flank_impulse(k, c, half, h, late, late, place[a], rate[a], new[a])
            off = abs(passed - at.carried[a] - at.slope[a] * new[a])
            size = at.inertia[a, a] * (abs(new[a]) + abs(rate[a]))
            if off > _MET * (size + abs(passed)):
                return False
    return True


@compiled(Count, Dense, Number, Row, Row, OutRow, OutRow, Count, _STEP)
def next_rates(
    gears: FloatArray,
    h: float,
    place: FloatArray,
    rate: FloatArray,
    rubs: FloatArray,
    new: FloatArray,
    known: int,
    at: LinkStep,
) -> int:
    """Write the rates (n,) at a step's end, and the friction that the links have had.

    Args:
        gears: (n, 4), see LINKS.
        h: [s].
        place, rate: (n,) deflections and their rates.
        rubs: (n,) friction, of the step before and then of this one.
        new: to write.
        known: flanks that `gain` is for, see `lean`.
        at: the step.

    Returns:
        the flanks that `gain` is for then.
    """
    n, rough = len(new), False
    for a in range(n):
        new[a], rough = rate[a], rough or at.level[a] > 0.0 or rubs[a] != 0.0
    right, whole = np.empty(n), np.empty((n, n))
    for turn in range(_ROUNDS):
        pattern = lean(gears, h, place, rate, new, turn >= _NEWTON, at)
        if pattern < 0 or pattern != known:
            known = pattern
            for a in range(n):
                for b in range(n):
                    whole[a, b] = at.inertia[a, b]
                whole[a, a] += at.slope[a]
            invert(whole, at.gain)
        for a in range(n):
            right[a] = -at.push[a] - h * rubs[a] - at.carried[a]
            for b in range(n):
                right[a] += at.by_rate[a, b] * rate[b] - at.by_place[a, b] * place[b]
        for a in range(n):
            new[a] = 0.0
            for b in range(n):
                new[a] += at.gain[a, b] * right[b]
        if rough:
            rub(new, rubs, at, h)
        if meets(gears, h, place, rate, new, at):
            break
    return known


@compiled(Nothing, LINKS.kind, Number, Number)
def follow_links(links: Any, step: float, farthest: float) -> None:
    """Write how n links move together behind their gears, S times, in each of W windows anew.

    Every step of the theta rule is linear in rates, deflections and loads, with the matrices of
    the middle of the step, but for the flanks: `flank_impulse`, solved by Newton's method, which
    takes one round unless a flank is reached or let go. Dry friction as in `rub`. What strays
    farther than `farthest` is not followed: from there on all is infinite.

    Args:
        links: a LINKS.
        step: distance of the samples [s].
        farthest: [rad].
    """
    d, v, gears, first = links.d, links.v, links.gears, links.first
    n, starts, h, window = d.shape[1], d.shape[2], step / links.parts, 0
    at = LinkStep(
        np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n),
        np.empty(n), np.empty(n), np.empty(n), np.empty(n),
    )  # fmt: skip
    place, rate, rubs = np.empty((starts, n)), np.empty((starts, n)), np.zeros((starts, n))
    new, lost = np.empty(n), np.zeros(starts)
    for i in range(d.shape[0] - 1):
        if window < first.size and first[window] == i:
            for s in range(starts):
                lost[s], rubs[s] = 0.0, 0.0
                for a in range(n):
                    place[s, a], rate[s, a] = links.begun[window, a, s], links.rates[window, a, s]
                    d[i, a, s], v[i, a, s] = place[s, a], rate[s, a]
            window += 1
        for part in range(links.parts):
            place_step(links, i, part, h, at)
            known = -1
            for s in range(starts):
                if lost[s] > 0.0:
                    continue
                known = next_rates(gears, h, place[s], rate[s], rubs[s], new, known, at)
                for a in range(n):
                    late = gears[a, LATE]
                    place[s, a] += h * ((1.0 - late) * rate[s, a] + late * new[a])
                    rate[s, a] = new[a]
                    links.dry[i, a, s] += rubs[s, a] / links.parts
                    if not abs(place[s, a]) < farthest:
                        lost[s] = 1.0
        for s in range(starts):
            for a in range(n):
                d[i + 1, a, s] = np.inf if lost[s] > 0.0 else place[s, a]
                v[i + 1, a, s] = np.inf if lost[s] > 0.0 else rate[s, a]
                links.ended[window - 1, a, s] = d[i + 1, a, s]
                links.last[window - 1, a, s] = v[i + 1, a, s]
