"""Steps of links behind gears that yield, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Places, Row, compiled, inner
from wbc.mechanics.laws import DAMPING, HALF, LATE, PLACE, RATE, STIFFNESS, flank_impulse
from wbc.mechanics.linear import dot, factor, solve_factored
from wbc.structures import structured

_Cube = Annotated[FloatArray, types.Array(types.float64, 3, "C", readonly=True)]
_OutCube = Annotated[FloatArray, types.Array(types.float64, 3, "C")]
_Windows = Annotated[FloatArray, types.Array(types.float64, 4, "C", readonly=True)]
_OutWindows = Annotated[FloatArray, types.Array(types.float64, 4, "C")]
_SWEEPS = 30
_SETTLED = 1e-9  # of the level
_NEWTON = 8  # rounds, after which flanks count with their largest slope: slow, but always nearer
_ROUNDS = 40
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


@structured
class Links(NamedTuple):
    """Links behind their gears along a log, in windows.

    Attributes:
        inertia, drag, pull: of the links at the samples (N, n, n), without their gears; straight
            lines between.
        load: torque of the links without deflection at the steps ((N - 1) parts + 1, n).
        speed, level: speed of the motors, level of the links' dry friction at the samples (N, n).
        gears: (n, 9) flanks, see `flank_impulse`; place and rate of a step are written there.
        first: number of the first sample of each window (W,), from 0 on.
        starts: deflections and their rates (W, 2, n, S) with which the windows begin.
        d, v: deflections and their rates (N, n, S) to write.
        dry: friction (N, n, S) to write, the mean of each interval; the last one stays.
        ends: deflections and rates (W, 2, n, S) to write, at the ends of the windows.
        parts: steps per sample.
    """

    inertia: _Cube
    drag: _Cube
    pull: _Cube
    load: Dense
    speed: Dense
    level: Dense
    gears: OutDense
    first: Places
    starts: _Windows
    d: _OutCube
    v: _OutCube
    dry: _OutCube
    ends: _OutWindows
    parts: int


class LinkStep(NamedTuple):
    """Memory for one step, and where the S motions are.

    Attributes:
        place, rate, rubs: (S, n) deflections, their rates, and the friction that links have had.
        mass, by_rate, by_place: (n, n) impulse per rate at the end, at the start, per deflection.
        whole, gain: (n, n) factors of impulse per rate at the end with the flanks, and rates per
            impulse, column by column.
        push, motor, held: (n,) impulse of the loads, speed of the motors, level of dry friction.
        carried, slope: (n,) impulse of the flanks at rest, and its change per rate.
        new: (n,) rates at the end.
        pivots: (n,) of `whole`.
    """

    place: OutDense
    rate: OutDense
    rubs: OutDense
    mass: OutDense
    by_rate: OutDense
    by_place: OutDense
    whole: OutDense
    gain: OutDense
    push: OutRow
    motor: OutRow
    held: OutRow
    carried: OutRow
    slope: OutRow
    new: OutRow
    pivots: OutPlaces


@inner
def rub(own: LinkStep, rubs: OutRow, h: float) -> None:
    """Change the rates `new` of links at a step's end, and the friction (n,) that they have had.

    Friction is what would stop a link by the end of the step of h [s], within its level; several
    links ask one another (Gauss-Seidel sweeps).
    """
    level, gain, new = own.held, own.gain, own.new
    for _ in range(_SWEEPS):
        settled = True
        for a in range(len(new)):
            if level[a] == 0.0 and rubs[a] == 0.0:
                continue
            wanted = rubs[a] + (new[a] + own.motor[a]) / (h * gain[a, a])
            wanted = min(max(wanted, -level[a]), level[a])
            change = wanted - rubs[a]
            rubs[a] = wanted
            settled = settled and abs(change) <= _SETTLED * level[a]
            for b in range(len(new)):
                new[b] -= h * gain[a, b] * change
        if settled or len(new) == 1:
            break


@inner
def place_step(links: Links, own: LinkStep, i: int, part: int, h: float) -> None:
    """Write a step of h [s], a `part` of the interval that begins with sample i."""
    middle, end = (part + 0.5) / links.parts, (part + 1.0) / links.parts
    now, n, gears = i * links.parts + part, len(own.push), links.gears
    for a in range(n):
        late = gears[a, LATE]
        early = 1.0 - late
        own.push[a] = h * (early * links.load[now, a] + late * links.load[now + 1, a])
        own.motor[a] = (1.0 - end) * links.speed[i, a] + end * links.speed[i + 1, a]
        own.held[a] = (1.0 - end) * links.level[i, a] + end * links.level[i + 1, a]
        for b in range(n):
            m = (1.0 - middle) * links.inertia[i, a, b] + middle * links.inertia[i + 1, a, b]
            c = (1.0 - middle) * links.drag[i, a, b] + middle * links.drag[i + 1, a, b]
            k = (1.0 - middle) * links.pull[i, a, b] + middle * links.pull[i + 1, a, b]
            other = gears[b, LATE]
            own.mass[a, b] = m + h * late * (c + h * other * k)
            own.by_rate[a, b] = m - h * (early * c + h * late * (1.0 - other) * k)
            own.by_place[a, b] = h * k


@inner
def lean(
    gears: OutDense, own: LinkStep, place: Row, rate: Row, h: float, steepest: bool
) -> tuple[int, bool]:
    """Write what flanks carry near the rates `new` of a step's end.

    Places and rates (n,) are those at the start of h [s]; where `steepest`, flanks count with their
    largest slope.

    Returns:
        the flanks that carry throughout, as a number, -1 where one is crossed; and whether what
        flanks pass is what they were taken to pass before.
    """
    pattern, met, new = 0, True, own.new
    for a in range(len(new)):
        flank, late = gears[a], gears[a, LATE]
        flank[PLACE], flank[RATE] = place[a], rate[a]
        passed, slope, touch, _ = flank_impulse(flank, new[a])
        off = abs(passed - own.carried[a] - own.slope[a] * new[a])
        size = own.mass[a, a] * (abs(new[a]) + abs(rate[a])) + abs(passed)
        met = met and (flank[HALF] == 0.0 or off <= _MET * size)
        if steepest or touch == 1.0:
            touch, slope = 1.0, h * late * (h * late * flank[STIFFNESS] + flank[DAMPING])
        if pattern >= 0 and touch == 1.0:
            pattern += 1 << a
        elif touch > 0.0:
            pattern = -1
        own.carried[a], own.slope[a] = passed - slope * new[a], slope
    return pattern, met


@inner
def invert(own: LinkStep) -> None:
    """Write the inverse `gain` of impulse per rate at the end with the flanks."""
    n = len(own.new)
    for a in range(n):
        for b in range(n):
            own.whole[a, b], own.gain[a, b] = own.mass[a, b], 1.0 if a == b else 0.0
        own.whole[a, a] += own.slope[a]
    if n == 1:
        own.gain[0, 0] /= own.whole[0, 0]
        return
    factor(own.whole, own.pivots)
    for a in range(n):
        solve_factored(own.whole, own.pivots, own.gain[a])


@inner
def next_rates(
    gears: OutDense, own: LinkStep, place: Row, rate: Row, rubs: OutRow, h: float, known: int
) -> int:
    """Write the rates `new` at a step's end, and the friction (n,) that the links have had.

    Places and rates (n,) are those at the start of h [s]; `known` are the flanks that `gain` is for
    (`lean`), and so is what is returned.
    """
    new, rough, bent = own.new, False, False
    for a in range(len(new)):
        new[a], rough = rate[a], rough or own.held[a] > 0.0 or rubs[a] != 0.0
        bent = bent or gears[a, HALF] > 0.0
    pattern, _ = lean(gears, own, place, rate, h, False)
    for turn in range(1, _ROUNDS + 1):
        if pattern < 0 or pattern != known:
            known = pattern
            invert(own)
        new[:] = 0.0
        for a in range(len(new)):
            right = dot(rate, own.by_rate[a]) - dot(place, own.by_place[a])
            right -= own.push[a] + h * rubs[a] + own.carried[a]
            for b in range(len(new)):
                new[b] += own.gain[a, b] * right
        if rough:
            rub(own, rubs, h)
        if not bent:  # springs are straight: what they pass is what they were taken to pass
            break
        pattern, met = lean(gears, own, place, rate, h, turn >= _NEWTON)
        if met:
            break
    return known


@inner
def pass_interval(links: Links, own: LinkStep, i: int, h: float, farthest: float) -> None:
    """Move all motions from sample i to the next one, in steps of h [s]; see `follow_links`."""
    gears = links.gears
    for part in range(links.parts):
        place_step(links, own, i, part, h)
        known = -1
        for s in range(len(own.place)):
            place, rate, rubs, lost = own.place[s], own.rate[s], own.rubs[s], False
            if not abs(place[0]) < np.inf:
                continue
            known = next_rates(gears, own, place, rate, rubs, h, known)
            for a in range(len(place)):
                late = gears[a, LATE]
                place[a] += h * ((1.0 - late) * rate[a] + late * own.new[a])
                rate[a] = own.new[a]
                links.dry[i, a, s] += rubs[a] / links.parts
                lost = lost or not abs(place[a]) < farthest
            if lost:
                place[:], rate[:] = np.inf, np.inf


@compiled
def follow_links(links: Links, step: float, farthest: float) -> None:
    """Write how n links move together behind their gears, S times, in each of W windows anew.

    Every step of the theta rule is linear in rates, deflections and loads, with the matrices of
    the middle of the step, but for the flanks: `flank_impulse`, solved by Newton's method, which
    takes one round unless a flank is reached or let go. Dry friction as in `rub`. What strays
    farther than `farthest` is not followed: from there on all is infinite.

    Args:
        links: see there.
        step: distance of the samples [s].
        farthest: [rad].
    """
    d, v, first, window = links.d, links.v, links.first, 0
    count, n, starts = d.shape
    own = LinkStep(
        np.zeros((starts, n)), np.zeros((starts, n)), np.zeros((starts, n)), np.empty((n, n)),
        np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n),
        np.empty(n), np.empty(n), np.zeros(n), np.zeros(n), np.empty(n),
        np.empty(n, dtype=np.int64),
    )  # fmt: skip
    for i in range(count - 1):
        if window < len(first) and first[window] == i:
            d[i], v[i] = links.starts[window, 0], links.starts[window, 1]
            own.place[:], own.rate[:], own.rubs[:] = d[i].T, v[i].T, 0.0
            window += 1
        pass_interval(links, own, i, step / links.parts, farthest)
        for s in range(starts):
            for a in range(n):
                d[i + 1, a, s] = links.ends[window - 1, 0, a, s] = own.place[s, a]
                v[i + 1, a, s] = links.ends[window - 1, 1, a, s] = own.rate[s, a]
