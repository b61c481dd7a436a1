"""Solving the rows of a step: Newton on the pieces of their laws; where that fails, harder ways.

Semi-smooth Newton with full steps is exact in one step once the pieces are the right ones, which
those of the step before usually are. A robot that lies on many points has more rows that hold than
freedoms, and so many splits of its forces that Newton turns in circles; so has one that stands
while dry friction holds its joints. Convex programs with shifted cones lead to one of the splits,
each with less compliance in its rows than the one before (`shifted_cones`); where too many rows
hold at the start, they come first. For gears that lock themselves there is no such program: their
steps are solved with a little compliance in every row about the last iterate, which carries nothing
at the fixed point (proximal points). Where all fail, friction gives way.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled, inner
from wbc.mechanics.linear import add_all, add_times, copy_to, dot, rest_of_way
from wbc.mechanics.pieces import solve_pieces
from wbc.mechanics.rows import RowSystem, copied, pieces_at
from wbc.mechanics.shifted_cones import compliance_of, minimise, slips

NEWTON, PROXIMAL, CONVEX, RANGES, PASSIVE, UNSOLVED, SEVERAL = range(7)
"""What found a solution, that only a passive end was found, nothing, or several; for RANGES and
SEVERAL see `wbc.sim.step.self_locking`."""

WAYS = ("newton", "proximal", "convex", "ranges", "passive")
"""The same as words."""

TOLERANCE = 1e-10
"""Accepted distance of a row from its law, as a share of the largest speed or target plus 1.

A target below zero does not count: a row reaches it only at speeds that count already, and a
barrier that is kept in a short part has one that no speed comes near.
"""

FULL_STEPS = 20
"""Solo12 in stance needs up to 5, a robot on 20 feet that rock 13. Of 1600 dense steps (corpora of
tests/sim/step/test_cones.py) 907, 1348, 1412 and 1474 settle within 6, 15, 20 and 30."""

SHORTENED, _SHORTEST = 12, 1e-2
_LOST, _PATIENCE = 10.0, 2
"""Of the residual at the start: a step that leads beyond it and does not halve the residual has
lost its way. The first one may throw the pieces about; two more show whether they come back."""
_ROUNDS, _STALLS, _LAST_STEPS = 40, 6, 6
"""Of convex programs; of those in a row that do not halve what is missed, before what is near is
taken; and of Newton's steps tried in between."""
_TURNS = 0.1
"""Share of what is missed that changing slips make, from which on these steps are tried where
rounds come no nearer: slips settle slowly, all else fast."""
_FIRMER, _TIMES, _FEW = 0.1, 3, 5
"""By which the compliance of the rounds falls, how often, and up to how many linear systems of a
round; twice more where rounds come no nearer. Hard steps among 482 of TALOS take up to 168 linear
systems so."""
_CLOSE, _NEAR, _PASSABLE = 30.0, 1e3, 1e6
"""Of the tolerance: where rounds that come no nearer may end; what counts as a solution; and where
impulses are good enough to say which friction there is."""
_PASSIVE_ROUNDS, _PASSIVE_SYSTEMS = 5, 100
_SOFTEST, _HARDEST, _FIRST = 1.0, 1e-9, 1e-6
_HARDER, _SOFTER, _PROXIMAL_ROUNDS = 0.3, 30.0, 60
_WORK = 1e8
"""Multiplications and additions, thrice as many, after which no other way is begun."""


@inner
def speeds_at(delassus: Dense, free: Row, impulse: Row, speed: OutRow) -> None:
    """Write free + delassus @ impulse (r,)."""
    for i in range(len(free)):
        speed[i] = free[i] + dot(impulse, delassus[i])


@compiled(counted=False)
def look_at(
    system: RowSystem, impulse: Row, speed: OutRow, pieces: OutDense, sliding: OutDense
) -> float:
    """Write the speeds and pieces at row impulses (r,); return the largest residual."""
    speeds_at(system.delassus, system.free, impulse, speed)
    return pieces_at(system, impulse, speed, pieces, sliding)


@compiled
def tolerance_of(system: RowSystem) -> float:
    """Return the largest distance of a row from its law in a solution, as a speed."""
    fastest = 0.0
    for i in range(len(system.free)):
        fastest = max(fastest, abs(system.free[i]))
    for i in range(len(system.targets)):
        fastest = max(fastest, system.targets[i])
    return TOLERANCE * (1.0 + fastest)


@compiled(inside=True)
def distance(system: RowSystem, impulse: Row) -> float:
    """Return how far the row farthest from its law is at row impulses (r,), as a speed."""
    size = len(impulse)
    pieces, sliding = np.empty((size, 4)), np.empty((len(system.frictions), 3))
    return look_at(system, impulse, np.empty(size), pieces, sliding)


@compiled(inside=True)
def holds_too_much(system: RowSystem, impulse: Row, tolerance: float) -> bool:
    """Return whether more rows hold at row impulses (r,) than there are coordinates, off the laws.

    Near the laws Newton's next step is the last one all the same, as in every step of a robot that
    has come to rest.
    """
    size, held = len(impulse), 0
    pieces, sliding = np.empty((size, 4)), np.empty((len(system.frictions), 3))
    off = look_at(system, impulse, np.empty(size), pieces, sliding)
    for i in range(size):
        held += pieces[i, 1] == 0.0
    return held > len(system.half) and off > _NEAR * tolerance


@inner
def merit_of(pieces: Dense) -> float:
    """Return the sum of the squares of the residuals."""
    merit = 0.0
    for i in range(len(pieces)):
        merit += pieces[i, 3] ** 2
    return merit


@compiled(inside=True)
def newton(
    system: RowSystem, start: Row, tolerance: float, whole: int, shortened: int, impulse: OutRow
) -> int:
    """Write the row impulses (r,) at which every row is on its law.

    Whole steps first: with the right pieces one step is exact. Where they do not settle, steps
    follow that are shortened until the residual falls; without any of these it ends where whole
    steps have lost their way.

    Args:
        system: of the rows.
        start: (r,).
        tolerance: largest accepted residual.
        whole, shortened: how many of these steps, at most.
        impulse: to write.

    Returns:
        the number of linear systems solved, as a negative number where it did not converge.
    """
    size, merit = len(start), 0.0
    pieces, sliding = np.empty((size, 4)), np.empty((len(system.frictions), 3))
    speed, aim, trial = np.empty(size), np.empty(size), np.empty(size)
    copy_to(start, impulse)
    first = before = look_at(system, impulse, speed, pieces, sliding)
    for iteration in range(1, whole + shortened + 1):
        if iteration == whole + 1:
            copy_to(start, impulse)
            look_at(system, impulse, speed, pieces, sliding)
            merit = merit_of(pieces)
        if not solve_pieces(system, pieces, sliding, impulse, aim):
            return -iteration
        share = 1.0
        while True:
            for i in range(size):
                trial[i] = impulse[i] + share * (aim[i] - impulse[i])
            worst, lower = look_at(system, trial, speed, pieces, sliding), merit_of(pieces)
            if iteration <= whole or lower < merit * (1.0 - 1e-3 * share) or share < _SHORTEST:
                break
            share *= 0.5
        merit = lower
        copy_to(trial, impulse)
        if worst <= tolerance:
            return iteration
        lost = worst > _LOST * first and worst > 0.5 * before
        if iteration > _PATIENCE and shortened == 0 and lost:
            return -iteration
        before = worst
    return -whole - shortened


@compiled(inside=True)
def softened(system: RowSystem, compliance: float, about: Row) -> RowSystem:
    """Return the system with a compliance in series with every row, unloaded at `about` (r,).

    It is a share of each row's own, 1/slope before tangents were paired.
    """
    soft = copied(system)
    for i in range(len(about)):
        own = compliance * 1e9 * system.spring[i]
        soft.delassus[i, i] += own
        soft.free[i] -= own * about[i]
        soft.spring[i] *= 1.0 + compliance
        soft.slope[i] /= 1.0 + compliance
    return soft


@compiled(inside=True)
def proximal(system: RowSystem, start: Row, tolerance: float, most: int, impulse: OutRow) -> int:
    """Write the row impulses (r,) by proximal rounds, like `newton`.

    A split of forces that has to move far (a corner of a sole that must let go before the rest
    fits) moves by rounding errors over compliance per round: each round that Newton solves makes
    the rows harder, each that it does not makes them softer. No round begins after `most` linear
    systems.
    """
    used, compliance = 0, _FIRST
    copy_to(start, impulse)
    following = np.empty(len(start))
    for _ in range(_PROXIMAL_ROUNDS):
        soft = softened(system, compliance, impulse)
        count = newton(soft, impulse, tolerance, FULL_STEPS, SHORTENED, following)
        used += abs(count)
        if distance(system, following) <= tolerance:
            copy_to(following, impulse)
            return used
        if count > 0:
            copy_to(following, impulse)
            compliance = max(_HARDER * compliance, _HARDEST)
        else:
            compliance *= _SOFTER
        if compliance > _SOFTEST or used > most:
            break
    return -used - 1


@compiled(inside=True)
def shift_cones(
    system: RowSystem, start: Row, tolerance: float, most: int, impulse: OutRow
) -> tuple[int, float]:
    """Write row impulses (r,) by rounds of convex programs, see `shifted_cones`.

    Args:
        system: of the rows; no law falls.
        start: (r,) impulses to begin at.
        tolerance: largest accepted residual.
        most: no round begins after as many linear systems.
        impulse: to write.

    Returns:
        the number of linear systems, and the distance of the farthest row from its law.
    """
    size, ways = len(start), np.ascontiguousarray(system.half.T)
    own, x, shift = np.empty(size), np.zeros(len(system.half)), np.zeros(len(system.frictions))
    about, speed, found = start.copy(), np.empty(size), np.empty(size)
    compliance_of(system, own)
    if dot(start, start) > 0.0:
        speeds_at(system.delassus, system.free, start, speed)
        slips(system, speed, shift)
        add_all(start, ways, x)
    used, least, halved, tried, stalls, firm = 0, np.inf, np.inf, np.inf, 0, 0
    for _ in range(_ROUNDS):
        count = minimise(system, ways, own, about, shift, x, speed, found)
        used += count
        turned = slips(system, speed, shift)
        copy_to(found, about)
        off = distance(system, found)
        if off < least:
            least = off
            copy_to(found, impulse)
        stalls += 1
        if least <= 0.5 * halved:
            halved, stalls = least, 0
        near = _CLOSE if stalls < _STALLS else _NEAR
        if least <= tolerance or (stalls and least <= near * tolerance) or used > most:
            break
        if firm >= _TIMES and stalls and turned > _TURNS * off and least <= 0.1 * tried:
            tried = least
            tries = newton(system, impulse, tolerance, _LAST_STEPS, 0, found)
            used += abs(tries)
            if tries > 0:
                copy_to(found, impulse)
                return used, tolerance
        if count <= _FEW and firm < _TIMES + (2 if stalls > 1 else 0):
            firm += 1
            own *= _FIRMER
    # With the slip kept, what rounds lead to is one convex program: its rows take energy.
    for _ in range(_ROUNDS if _NEAR * tolerance < least <= _PASSABLE * tolerance else 0):
        used += minimise(system, ways, own, about, shift, x, speed, impulse)
        least, moved = distance(system, impulse), 0.0
        for i in range(size):
            moved = max(moved, own[i] * abs(impulse[i] - about[i]))
        copy_to(impulse, about)
        if moved <= _CLOSE * tolerance:
            break
    return used, least


@compiled(inside=True)
def solve_system(
    system: RowSystem, start: Row, tolerance: float, work: float, impulse: OutRow
) -> tuple[int, int]:
    """Write the row impulses (r,) at which every row is on its law.

    Where convex programs come near the laws but not to them, the last one is a passive end. Where
    they do not come near, contacts get the friction that the impulses found so far allow, whatever
    they press then, and gears that lock themselves pass nothing back. That is a convex program,
    too. Rounds with the friction that each solution allows come nearer (Haslinger's iteration).

    Args:
        system: of the rows.
        start: (r,) impulses of the step before, or zeros.
        tolerance: largest accepted residual.
        work: share of `_WORK` beyond which nothing more is tried; below one for what may fail, and
            has no passive end.
        impulse: to write.

    Returns:
        the number of linear systems solved, and what found them: PASSIVE ends miss some laws,
        and there is none where ground squeezes or nothing is a number.
    """
    size = len(start)
    if size == 0:
        return 0, NEWTON
    n, used, good, shortened = len(system.half), 0, 0.0, 0
    for i in range(len(system.laws)):
        if system.laws[i, 4] < 0.0:
            shortened = SHORTENED
    if shortened or not holds_too_much(system, start, tolerance):
        used = newton(system, start, tolerance, FULL_STEPS, shortened, impulse)
        if used > 0:
            return used, NEWTON
        used = -used
    if shortened:  # no convex program follows: the last step's pieces may lead astray
        count = newton(system, np.zeros(size), tolerance, FULL_STEPS, shortened, impulse)
        used += abs(count)
        if count > 0:
            return used, NEWTON
    for i in range(size):
        good += system.free[i] + system.delassus[i, i]
    if not np.isfinite(good):
        return used, UNSOLVED
    found, least = np.zeros(size), np.inf
    copy_to(start, impulse)
    if shortened == 0:
        most = int(work * _WORK / (n * n * (3 * size + n)))
        count, least = shift_cones(system, start, tolerance, most, impulse)
        used += count
        if least <= _NEAR * tolerance:
            return used, CONVEX
    for fresh in range(2 if shortened else 1):
        if fresh:
            impulse[:] = 0.0
        count = proximal(system, impulse, tolerance, int(work * _WORK / size**3), found)
        used += abs(count)
        if count > 0:
            copy_to(found, impulse)
            return used, PROXIMAL
    if least <= _PASSABLE * tolerance:
        return used, PASSIVE
    # Where the cones cannot be met, impulses grow without end: begin without friction.
    convex, passive = copied(system), UNSOLVED
    first = len(system.laws) + len(system.targets) - len(system.frictions)
    impulse[:], convex.frictions[:] = 0.0, 0.0
    for i in range(len(system.laws)):
        convex.laws[i, 4] = max(system.laws[i, 4], 0.0)
    for _ in range(_PASSIVE_ROUNDS if work >= 1.0 else 0):
        for i in range(len(convex.grips)):
            convex.grips[i] = system.frictions[i] * max(impulse[first + i], 0.0)
        count = newton(convex, impulse, 0.1 * tolerance, FULL_STEPS, 0, found)
        used += abs(count)
        if count < 0:
            count = proximal(convex, impulse, 0.1 * tolerance, _PASSIVE_SYSTEMS, found)
            used += abs(count)
        if count < 0:
            break
        passive = PASSIVE
        copy_to(found, impulse)
    return used, passive


@compiled(counted=False)
def velocity_after(system: RowSystem, lower: Dense, free: Row, impulse: Row, after: OutRow) -> None:
    """Write v (n,) after row impulses (r,).

    Args:
        system: of the rows.
        lower: L (n, n) with L' L = H_l.
        free: v (n,) without the rows.
        impulse: (r,).
        after: to write.
    """
    for j in range(len(free)):
        after[j] = dot(impulse, system.half[j])
    rest_of_way(lower, after)
    add_times(1.0, free, after)
