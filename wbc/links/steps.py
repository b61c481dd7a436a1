"""Steps of links behind gears that yield, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.

`LINKS` holds n links along N samples in W windows, which move S times:

    inertia, drag, pull     (N, n, n) of the links without their gears; straight lines between
    load                    ((N - 1) parts + 1, n) torque of the links without deflection, at steps
    speed, level            (N, n) speed of the motors, level of the links' dry friction
    gears                   (n, 9) flanks, see `flank_impulse`; a step writes place and rate there
    first                   (W,) number of the first sample of each window, from 0 on
    starts                  (W, 2, n, S) deflections and their rates with which windows begin
    d, v                    (N, n, S) deflections and their rates, written
    dry                     (N, n, S) mean friction of each interval, written; the last one stays
    ends                    (W, 2, n, S) deflections and rates at the ends of windows, written
    parts                   steps per sample

and memory for one step:

    place, rate, rubs       (S, n) deflections, their rates, and friction that links have had
    mass, by_rate, by_place (n, n) impulse per rate at the end, at the start, per deflection
    whole, pivots, gain     factors of impulse per rate at the end with the flanks, and its inverse
    push, motor, held       (n,) impulse of the loads, speed of the motors, level of dry friction
    carried, slope          (n,) impulse of the flanks at rest, and its change per rate
    new                     (n,) rates at the end
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Count, Dense, OutDense, OutPlaces, OutRow, Places, Row, compiled, inner
from wbc.mechanics.laws import DAMPING, HALF, LATE, PLACE, RATE, STIFFNESS, flank_impulse
from wbc.mechanics.linear import dot, factor, solve_factored
from wbc.structures import Structure

_Cube = Annotated[FloatArray, types.Array(types.float64, 3, "C", readonly=True)]
_OutCube = Annotated[FloatArray, types.Array(types.float64, 3, "C")]
_Windows = Annotated[FloatArray, types.Array(types.float64, 4, "C", readonly=True)]
_OutWindows = Annotated[FloatArray, types.Array(types.float64, 4, "C")]
_SWEEPS = 30
_SETTLED = 1e-9  # of the level
_NEWTON = 8  # rounds, after which flanks count with their largest slope: slow, but always nearer
_ROUNDS = 40
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law

LINKS = Structure(
    "Links",
    (_Cube, "inertia drag pull"),
    (Dense, "load speed level"),
    (OutDense, "gears"),
    (Places, "first"),
    (_Windows, "starts"),
    (_OutCube, "d v dry", "N", "n", "S"),
    (_OutWindows, "ends", "W", 2, "n", "S"),
    (OutDense, "place rate rubs", "S", "n"),
    (OutDense, "mass by_rate by_place whole gain", "n", "n"),
    (OutRow, "push motor held carried slope new", "n"),
    (OutPlaces, "pivots", "n"),
    parts=Count,
)
Links = Annotated[Any, LINKS.kind]


@inner
def rub(links: Links, rubs: OutRow, h: float) -> None:
    """Change the rates `new` of links at a step's end, and the friction (n,) that they have had.

    Friction is what would stop a link by the end of the step of h [s], within its level; several
    links ask one another (Gauss-Seidel sweeps).
    """
    level, gain, new = links.held, links.gain, links.new
    for _ in range(_SWEEPS):
        settled = True
        for a in range(len(new)):
            if level[a] == 0.0 and rubs[a] == 0.0:
                continue
            wanted = rubs[a] + (new[a] + links.motor[a]) / (h * gain[a, a])
            wanted = min(max(wanted, -level[a]), level[a])
            change = wanted - rubs[a]
            rubs[a] = wanted
            settled = settled and abs(change) <= _SETTLED * level[a]
            for b in range(len(new)):
                new[b] -= h * gain[a, b] * change
        if settled or len(new) == 1:
            break


@inner
def place_step(links: Links, i: int, part: int, h: float) -> None:
    """Write a step of h [s], a `part` of the interval that begins with sample i."""
    middle, end = (part + 0.5) / links.parts, (part + 1.0) / links.parts
    now, n, gears = i * links.parts + part, len(links.push), links.gears
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


@inner
def lean(links: Links, place: Row, rate: Row, h: float, steepest: bool) -> tuple[int, bool]:
    """Write what flanks carry near the rates `new` of a step's end.

    Places and rates (n,) are those at the start of h [s]; where `steepest`, flanks count with their
    largest slope.

    Returns:
        the flanks that carry throughout, as a number, -1 where one is crossed; and whether what
        flanks pass is what they were taken to pass before.
    """
    pattern, met, new = 0, True, links.new
    for a in range(len(new)):
        flank, late = links.gears[a], links.gears[a, LATE]
        flank[PLACE], flank[RATE] = place[a], rate[a]
        passed, slope, touch, _ = flank_impulse(flank, new[a])
        off = abs(passed - links.carried[a] - links.slope[a] * new[a])
        size = links.mass[a, a] * (abs(new[a]) + abs(rate[a])) + abs(passed)
        met = met and (flank[HALF] == 0.0 or off <= _MET * size)
        if steepest or touch == 1.0:
            touch, slope = 1.0, h * late * (h * late * flank[STIFFNESS] + flank[DAMPING])
        if pattern >= 0 and touch == 1.0:
            pattern += 1 << a
        elif touch > 0.0:
            pattern = -1
        links.carried[a], links.slope[a] = passed - slope * new[a], slope
    return pattern, met


@inner
def invert(links: Links) -> None:
    """Write the inverse `gain` of impulse per rate at the end with the flanks."""
    n = len(links.new)
    for a in range(n):
        for b in range(n):
            links.whole[a, b], links.gain[a, b] = links.mass[a, b], 1.0 if a == b else 0.0
        links.whole[a, a] += links.slope[a]
    if n == 1:
        links.gain[0, 0] /= links.whole[0, 0]
        return
    factor(links.whole, links.pivots)
    for a in range(n):
        solve_factored(links.whole, links.pivots, links.gain[a])


@inner
def next_rates(links: Links, place: Row, rate: Row, rubs: OutRow, h: float, known: int) -> int:
    """Write the rates `new` at a step's end, and the friction (n,) that the links have had.

    Places and rates (n,) are those at the start of h [s]; `known` are the flanks that `gain` is for
    (`lean`), and so is what is returned.
    """
    new, rough, bent = links.new, False, False
    for a in range(len(new)):
        new[a], rough = rate[a], rough or links.held[a] > 0.0 or rubs[a] != 0.0
        bent = bent or links.gears[a, HALF] > 0.0
    pattern, _ = lean(links, place, rate, h, False)
    for turn in range(1, _ROUNDS + 1):
        if pattern < 0 or pattern != known:
            known = pattern
            invert(links)
        new[:] = 0.0
        for a in range(len(new)):
            right = dot(rate, links.by_rate[a]) - dot(place, links.by_place[a])
            right -= links.push[a] + h * rubs[a] + links.carried[a]
            for b in range(len(new)):
                new[b] += links.gain[a, b] * right
        if rough:
            rub(links, rubs, h)
        if not bent:  # springs are straight: what they pass is what they were taken to pass
            break
        pattern, met = lean(links, place, rate, h, turn >= _NEWTON)
        if met:
            break
    return known


@inner
def pass_interval(links: Links, i: int, h: float, farthest: float) -> None:
    """Move all motions from sample i to the next one, in steps of h [s]; see `follow_links`."""
    gears = links.gears
    for part in range(links.parts):
        place_step(links, i, part, h)
        known = -1
        for s in range(len(links.place)):
            place, rate, rubs, lost = links.place[s], links.rate[s], links.rubs[s], False
            if not abs(place[0]) < np.inf:
                continue
            known = next_rates(links, place, rate, rubs, h, known)
            for a in range(len(place)):
                late = gears[a, LATE]
                place[a] += h * ((1.0 - late) * rate[a] + late * links.new[a])
                rate[a] = links.new[a]
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
        links: see `LINKS`.
        step: distance of the samples [s].
        farthest: [rad].
    """
    d, v, first, window = links.d, links.v, links.first, 0
    count, n, starts = d.shape
    for i in range(count - 1):
        if window < len(first) and first[window] == i:
            d[i], v[i] = links.starts[window, 0], links.starts[window, 1]
            links.place[:], links.rate[:], links.rubs[:] = d[i].T, v[i].T, 0.0
            window += 1
        pass_interval(links, i, step / links.parts, farthest)
        for s in range(starts):
            for a in range(n):
                d[i + 1, a, s] = links.ends[window - 1, 0, a, s] = links.place[s, a]
                v[i + 1, a, s] = links.ends[window - 1, 1, a, s] = links.rate[s, a]
