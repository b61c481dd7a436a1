"""Steps of links behind gears that yield, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Places,
    compiled,
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

MATRICES = "mass", "by_rate", "by_place", "whole", "gain"
VECTORS = "push", "motor", "held", "carried", "slope", "right", "new"

LINKS = Structure(
    "Links",
    **dict.fromkeys(("inertia", "drag", "pull"), _Cube),
    **dict.fromkeys(("load", "speed", "level", "gears"), Dense),
    first=Places,
    **dict.fromkeys(("begun", "rates"), _Cube),
    **dict.fromkeys(("d", "v", "dry", "ended", "last"), _OutCube),
    **dict.fromkeys(("place", "rate", "rubs"), OutDense),
    **dict.fromkeys(MATRICES, OutDense),
    **dict.fromkeys(VECTORS, OutRow),
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
    place, rate, rubs: (S, n) where the links are, zero for the friction that they had.
    mass, by_rate, by_place: (n, n) memory for one step: impulse per rate at the end, at the start,
        per deflection.
    whole, gain: (n, n) ... impulse per rate at the end with the flanks, and rates per impulse.
    push, motor, held: (n,) ... impulse of the loads, speed of the motors, level of dry friction.
    carried, slope: (n,) ... impulse of the flanks at rest, and its change per rate.
    right, new: (n,) ... impulse without that of the rates at the end, and these.
    parts: steps per sample.
"""

STIFFNESS, DAMPING, HALF, LATE = range(4)


@compiled(Nothing, LINKS.kind, counted=False)
def invert(links: Any) -> None:
    """Write the inverse `gain` of `whole` (n, n), which is used up.

    The inertia outweighs the rest at short steps: elimination needs no exchange of rows.
    """
    whole, inverse = links.whole, links.gain
    n = whole.shape[0]
    if n == 1:
        inverse[0, 0] = 1.0 / whole[0, 0]
        return
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


@compiled(Nothing, LINKS.kind, Count, Number, counted=False)
def rub(links: Any, s: int, h: float) -> None:
    """Change the rates `new` of links at a step's end, and the friction that they have had.

    Friction is what would stop a link by the step's end, within its level; several links ask one
    another (Gauss-Seidel sweeps).

    Args:
        links: with the friction `rubs`.
        s: number of the motion.
        h: [s].
    """
    level, gain, rubs, new = links.held, links.gain, links.rubs, links.new
    n = new.size
    for _ in range(_SWEEPS):
        settled = True
        for a in range(n):
            if level[a] == 0.0 and rubs[s, a] == 0.0:
                continue
            wanted = rubs[s, a] + (new[a] + links.motor[a]) / (h * gain[a, a])
            wanted = min(max(wanted, -level[a]), level[a])
            change = wanted - rubs[s, a]
            rubs[s, a] = wanted
            settled = settled and abs(change) <= _SETTLED * level[a]
            for b in range(n):
                new[b] -= h * gain[b, a] * change
        if settled or n == 1:
            break


@compiled(Nothing, LINKS.kind, Count, Count, Number, counted=False)
def place_step(links: Any, i: int, part: int, h: float) -> None:
    """Write a step of h [s], a `part` of the interval that begins with sample i."""
    middle, end = (part + 0.5) / links.parts, (part + 1.0) / links.parts
    now, n, gears = i * links.parts + part, links.push.size, links.gears
    for a in range(n):
        late = gears[a, LATE]
        early = 1.0 - late
        links.push[a] = h * (early * links.load[now, a] + late * links.load[now + 1, a])
        links.motor[a] = (1.0 - end) * links.speed[i, a] + end * links.speed[i + 1, a]
        links.held[a] = (1.0 - end) * links.level[i, a] + end * links.level[i + 1, a]
        for b in range(n):
            m = (1.0 - middle) * links.inertia[i, a, b] + middle * links.inertia[i + 1, a, b]
            c = (1.0 - middle) * links.drag[i, a, b] + middle * links.drag[i + 1, a, b]
            k = (1.0 - middle) * links.pull[i, a, b] + middle * links.pull[i + 1, a, b]
            other = gears[b, LATE]
            links.mass[a, b] = m + h * late * (c + h * other * k)
            links.by_rate[a, b] = m - h * (early * c + h * late * (1.0 - other) * k)
            links.by_place[a, b] = h * k


@compiled(Count, LINKS.kind, Count, Number, Flag, counted=False)
def lean(links: Any, s: int, h: float, steepest: bool) -> int:
    """Write what flanks carry near the rates `new` of a step's end.

    Args:
        links: a LINKS.
        s: number of the motion.
        h: [s].
        steepest: whether flanks count with their largest slope.

    Returns:
        the flanks that carry throughout, as a number; -1 where one is crossed.
    """
    pattern, gears, new = 0, links.gears, links.new
    for a in range(new.size):
        k, c, half, late = gears[a, STIFFNESS], gears[a, DAMPING], gears[a, HALF], gears[a, LATE]
        carried, slope, touch, _ = flank_impulse(
            k, c, half, h, late, late, links.place[s, a], links.rate[s, a], new[a]
        )
        if steepest or touch == 1.0:
            touch, slope = 1.0, h * late * (h * late * k + c)
        if pattern >= 0 and touch == 1.0:
            pattern += 1 << a
        elif touch > 0.0:
            pattern = -1
        links.carried[a], links.slope[a] = carried - slope * new[a], slope
    return pattern


@compiled(Flag, LINKS.kind, Count, Number, counted=False)
def meets(links: Any, s: int, h: float) -> bool:
    """Return whether flanks pass at `new` what the step took them to; others as of `lean`."""
    gears, new, place, rate = links.gears, links.new, links.place, links.rate
    for a in range(new.size):
        k, c, half, late = gears[a, STIFFNESS], gears[a, DAMPING], gears[a, HALF], gears[a, LATE]
        if half > 0.0:
            passed, _, _, _ = flank_impulse(
                k, c, half, h, late, late, place[s, a], rate[s, a], new[a]
            )
            off = abs(passed - links.carried[a] - links.slope[a] * new[a])
            size = links.mass[a, a] * (abs(new[a]) + abs(rate[s, a]))
            if off > _MET * (size + abs(passed)):
                return False
    return True


@compiled(Count, LINKS.kind, Count, Number, Count, counted=False)
def next_rates(links: Any, s: int, h: float, known: int) -> int:
    """Write the rates `new` at a step's end, and the friction that the links have had.

    Args:
        links: a LINKS.
        s: number of the motion.
        h: [s].
        known: flanks that `gain` is for, see `lean`.

    Returns:
        the flanks that `gain` is for then.
    """
    place, rate, rubs, new, right = links.place, links.rate, links.rubs, links.new, links.right
    n, rough = new.size, False
    for a in range(n):
        new[a], rough = rate[s, a], rough or links.held[a] > 0.0 or rubs[s, a] != 0.0
    for turn in range(_ROUNDS):
        pattern = lean(links, s, h, turn >= _NEWTON)
        if pattern < 0 or pattern != known:
            known = pattern
            for a in range(n):
                for b in range(n):
                    links.whole[a, b] = links.mass[a, b]
                links.whole[a, a] += links.slope[a]
            invert(links)
        for a in range(n):
            right[a] = -links.push[a] - h * rubs[s, a] - links.carried[a]
            for b in range(n):
                right[a] += links.by_rate[a, b] * rate[s, b] - links.by_place[a, b] * place[s, b]
        for a in range(n):
            new[a] = 0.0
            for b in range(n):
                new[a] += links.gain[a, b] * right[b]
        if rough:
            rub(links, s, h)
        if meets(links, s, h):
            break
    return known


@compiled(Nothing, LINKS.kind, Number, Number, counted=False)
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
    d, v, first, gears, new = links.d, links.v, links.first, links.gears, links.new
    place, rate, rubs = links.place, links.rate, links.rubs
    n, starts, h, window = d.shape[1], d.shape[2], step / links.parts, 0
    for i in range(d.shape[0] - 1):
        if window < first.size and first[window] == i:
            for s in range(starts):
                for a in range(n):
                    place[s, a], rate[s, a] = links.begun[window, a, s], links.rates[window, a, s]
                    d[i, a, s], v[i, a, s], rubs[s, a] = place[s, a], rate[s, a], 0.0
            window += 1
        for part in range(links.parts):
            place_step(links, i, part, h)
            known = -1
            for s in range(starts):
                if not abs(place[s, 0]) < np.inf:
                    continue
                known = next_rates(links, s, h, known)
                lost = False
                for a in range(n):
                    late = gears[a, LATE]
                    place[s, a] += h * ((1.0 - late) * rate[s, a] + late * new[a])
                    rate[s, a] = new[a]
                    links.dry[i, a, s] += rubs[s, a] / links.parts
                    lost = lost or not abs(place[s, a]) < farthest
                if lost:
                    place[s, :], rate[s, :] = np.inf, np.inf
        for s in range(starts):
            for a in range(n):
                d[i + 1, a, s] = links.ended[window - 1, a, s] = place[s, a]
                v[i + 1, a, s] = links.last[window - 1, a, s] = rate[s, a]
