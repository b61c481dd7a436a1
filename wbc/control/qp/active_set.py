"""The rows that bound the last solution, tried and corrected: what solves most ticks, compiled.

Without inequalities, with the rows G x + S y = t and the diagonal D of a program in blocks,

    (G D^-1 G' + S) lambda = t - G D^-1 p,      x = D^-1 (p + G' lambda),

a positive definite system as large as G has rows: a third to a half of the variables. Bounds that
bind are further hard rows of G. Starting from those of the last solution, rows that pull instead of
push are dropped, and rows that are violated are added one by one (Goldfarb & Idnani, 1983). Where
nothing changes any more all conditions of optimality hold, and the solution comes from the small
system, whose residual is checked.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from wbc.compiled import OutDense, OutPlaces, OutRow, Row, compiled, inner
from wbc.control.qp.linalg import drop_row, factorise_from, substitute, substitute_back
from wbc.control.qp.solvers import INFINITE
from wbc.mechanics.linear import add_times, copy_to, dot
from wbc.structures import Structure

_SOLVES = 4  # two suffice but where rows all but repeat each other
_DIGITS = 1e-12  # of the largest right side, which rounding leaves of it
_ROUNDING = 10.0  # equations of hundreds of newtons are met to 1e-6 N without a refinement
FEW = 8
"""Steps that are worth a try where the bounds that bind are all but known.

In squats in which a torque limit binds, a searched tick of Solo12 takes 255 us without a try and
99 with one; of Talos, with 0.3 rad/s of noise, 512 without and 498, 280 and 264 with 8, 16 and 32
steps. But then the worst of 1000 hostile ticks of Solo12 takes 20, 26 and 33 good ones.
"""
UNSETTLED = -1
"""What `settle` returns where it finds no solution."""
_DECIDED = 1e-12  # share of a squared length that other rows leave of a row which they decide
STEPS = 32
"""Steps that are worth a try elsewhere: daqp takes a third of their time, but has to begin.

With 16, 32 and 48 the median hostile tick of Solo12 takes 269, 208 and 189 us, the 99th percentile
is 418, 460 and 478 us. Each step takes one bound: where more are broken at first, none is tried.
"""

# A program that keeps its structure, a diagonal D and rows, and memory for its solution.
#
#     min   1/2 x'D x - pull'x + 1/2 sum over the soft rows of (G x - right)^2 / softness
#                              + 1/2 sum over the bounds that give of (beyond)^2 / give
#     s.t.  G x = right in the hard rows, lower <= C x <= upper in all other bounds
#
# Below the program's own rows (.., n) there is room for n bounds that bind. `taken` (r,) says which
# do: +1 the upper one, -1 the lower one, 0 neither; it is what a tick starts from. `give` (r,) is
# the softness of a bound that binds, 0 for one that must be kept. `force` (..,) are the multipliers
# of all rows, `active` the numbers of the bounds that stand among them, `push` how hard these push,
# and `last` (n,) the last solution. `sizes` (2,): BASE, how many rows stand before the bounds, and
# START, the first bound that the program has. `tolerance` (1,) is how far beyond its bound a row
# may be, and a push below zero.
SOLVER = Structure(
    "Solver",
    (OutDense, "rows scaled", "k", "n"),
    (OutRow, "right softness force left missing", "k"),
    (OutRow, "diagonal pull inverse free last trial", "n"),
    (OutDense, "C", "r", "n"),
    (OutRow, "lower upper give push", "r"),
    (OutPlaces, "active", "k"),
    (OutPlaces, "taken", "r"),
    (OutDense, "system", "k", "k"),
    (OutPlaces, "sizes", 2),
    (Row, "tolerance"),
)
BASE, START = range(2)
SolverMemory = Annotated[Any, SOLVER.kind]


@inner
def place_row(solver: SolverMemory, place: int, row: Row, right: float, softness: float) -> None:
    """Write a row of G, what stands behind the given entries as zeros."""
    solver.right[place], solver.softness[place] = right, softness
    copy_to(row, solver.rows[place])
    solver.rows[place, len(row) :] = 0.0


@inner
def _try_rows(solver: SolverMemory, known: int, size: int, x: OutRow, base: int) -> bool:
    """Solve (G D^-1 G' + S) force = right - G free for x = free + D^-1 G' force.

    The half solution L^-1 (right - G free) of the rows that are known stands in `left`.

    Args:
        known: rows that the last call had as well.
        size: how many of its rows are G.
        x: result (n,).
        base: from which row on one that the others all but decide is none to solve with.

    Returns:
        whether the rows are independent.
    """
    G, right, free, force = solver.rows, solver.right, solver.free, solver.force
    left, scaled, factor, inverse = solver.left, solver.scaled, solver.system, solver.inverse
    for i in range(known, size):  # what was the system is its factor where it is known
        for j in range(len(inverse)):
            scaled[i, j] = G[i, j] * inverse[j]
        for k in range(i + 1):
            factor[i, k] = dot(scaled[i], G[k])
        factor[i, i] += solver.softness[i]
    if not factorise_from(factor, known, size):
        return False
    for i in range(known, size):
        half, whole = right[i] - dot(G[i], free), solver.softness[i]
        left[i] = (half - dot(left[:i], factor[i])) * factor[i, i]
        if i >= base and (whole + dot(scaled[i], G[i])) * factor[i, i] ** 2 > 1.0 / _DECIDED:
            return False
    copy_to(left[:size], force)
    copy_to(free, x)
    substitute_back(factor, size, force)
    for i in range(size):
        add_times(force[i], scaled[i], x)
    return True


@inner
def _meet_rows(solver: SolverMemory, known: int, size: int, x: OutRow) -> bool:
    """Do as `_try_rows`, and correct x (n,) until the rows are met; return whether they are."""
    if not _try_rows(solver, known, size, x, size):
        return False
    G, right, softness = solver.rows, solver.right, solver.softness
    force, missing, scaled, largest = solver.force, solver.missing, solver.scaled, 0.0
    for i in range(size):
        largest = max(largest, abs(right[i]))
    allowed = max(_ROUNDING * solver.tolerance[0], _DIGITS * largest) ** 2
    for _ in range(_SOLVES):
        total = 0.0
        for i in range(size):
            missing[i] = right[i] - softness[i] * force[i] - dot(G[i], x)
            total += missing[i] * missing[i]
        if total <= allowed:
            return True
        # x moves by corrections alone: summed anew from `force`, large terms that all but cancel
        # would leave 1e-16 of the largest, which is a thousand times what the rows may miss
        substitute(solver.system, size, missing)
        for i in range(size):
            force[i] += missing[i]
            add_times(missing[i], scaled[i], x)
    return False


@inner
def _place_bound(solver: SolverMemory, place: int, row: int) -> int:
    """Write a bound that binds into a place of G; return the next one."""
    right = solver.upper[row] if solver.taken[row] > 0 else solver.lower[row]
    place_row(solver, place, solver.C[row], right, solver.give[row])
    return place + 1


@inner
def _place_active(solver: SolverMemory) -> int:
    """Write the bounds that bind below the other rows of G; return how many rows there are.

    -1 where there is no room. Bounds that are none in this program are let go of.
    """
    taken, active, size = solver.taken, solver.active, solver.sizes[BASE]
    for i in range(solver.sizes[START], len(taken)):
        if abs(solver.upper[i] if taken[i] > 0 else solver.lower[i]) >= INFINITE:
            taken[i] = 0
        if taken[i] != 0:
            if size == len(solver.right):
                return -1
            active[size - solver.sizes[BASE]] = i
            size = _place_bound(solver, size, i)
    return int(size)


@inner
def _most_violated(solver: SolverMemory, tolerance: float, x: Row) -> tuple[int, int, int]:
    """Return which bound x (n,) breaks most for its size, on which side, and how many it breaks.

    Without any the first one is -1.
    """
    C, lower, upper, inverse = solver.C, solver.lower, solver.upper, solver.inverse
    best, side, count, worst = -1, 0, 0, 0.0
    for i in range(solver.sizes[START], len(upper)):
        if solver.taken[i] != 0:
            continue
        value = dot(C[i], x)
        beyond = max(value - upper[i], lower[i] - value)
        if beyond > tolerance:
            length, count = solver.give[i], count + 1
            for j in range(len(x)):
                length += C[i, j] * C[i, j] * inverse[j]
            if beyond * beyond > worst * length:
                best, worst = i, beyond * beyond / length
                side = 1 if value > upper[i] else -1
    return best, side, count


@inner
def _go_on(solver: SolverMemory, size: int, met: bool) -> int:
    """Change all pushes until one reaches zero; return its bound, -1 where none stops the others.

    They move towards those of the system with the last of `size` rows, as `_try_rows` leaves it.
    Where the others decide that row (not `met`), it pushes more and more, and they give back what
    it takes of each motion: nothing moves.
    """
    factor, change, taken, active = solver.system, solver.force, solver.taken, solver.active
    push, base = solver.push, solver.sizes[BASE]
    if not met:
        side, last = taken[active[size - base - 1]], size - 1
        for i in range(size):
            change[i] = factor[last, i] * side if i < last else -side
        substitute_back(factor, last, change)
    leaving, share = -1, 1.0 if met else np.inf
    for k in range(size - base):
        change[base + k] *= -taken[active[k]]
        change[base + k] -= push[k] if met else 0.0
        falls = -change[base + k] if solver.give[active[k]] == 0.0 else 0.0
        if push[k] < share * falls:
            leaving, share = k, push[k] / falls
    for k in range(size - base if share < np.inf else 0):
        push[k] += share * change[base + k]
    return leaving


@inner
def _let_go(solver: SolverMemory, size: int, known: int, bound: int) -> None:
    """Take one of the bounds out of the `size` rows of G, of which `known` ones are factorised."""
    active, push, base = solver.active, solver.push, solver.sizes[BASE]
    solver.taken[active[bound]] = 0
    drop_row(solver.system, solver.left, base + bound, known)
    for k in range(bound, size - 1 - base):
        active[k], push[k] = active[k + 1], push[k + 1]
        _place_bound(solver, base + k, active[k])
        copy_to(solver.scaled[base + k + 1], solver.scaled[base + k])


@inner
def _begin(solver: SolverMemory, many: int, x: OutRow) -> int:
    """Solve with the bounds taken as binding, and let go of those that pull until none does.

    Args:
        many: bounds broken at first with which it goes on.

    Returns:
        how many rows G has, -1 where even those that are no bounds depend on one another.
    """
    base, push, tolerance = solver.sizes[BASE], solver.push, solver.tolerance[0]
    active, taken, force, known, pulls = solver.active, solver.taken, solver.force, 0, True
    size = _place_active(solver)
    while pulls:
        if size < 0 or not _meet_rows(solver, known, size, x):
            if size == base:
                return UNSETTLED
            taken[:], known, size = 0, 0, base
            continue
        fresh, pulls, known = known == 0, False, size
        for k in range(known - base - 1, -1, -1):
            # to drop what hardly pulls as well would drop and take some rows in turns
            pull = force[base + k] * taken[active[k]]
            if pull > tolerance and solver.give[active[k]] == 0.0:
                _let_go(solver, size, size, k)
                size, pulls = size - 1, True
        if fresh and pulls and _most_violated(solver, tolerance, x)[2] > many:
            return UNSETTLED
        known = size
    for k in range(size - base):
        push[k] = max(-force[base + k] * taken[active[k]], 0.0)
    return size


@compiled(counted=False)
def settle(solver: SolverMemory, steps: int, x: OutRow) -> tuple[int, int]:
    """Solve with the bounds taken as binding; add bounds one by one, dropping what would pull.

    The dual method of Goldfarb & Idnani (1983) on the small system. The bound that is broken most
    is taken, and its multiplier grows from zero: the multipliers of the others change in a straight
    line to those of the system with it. The first one that reaches zero on the way is dropped, and
    the way goes on without it. Every step raises the least cost that the bounds met so far allow,
    so that no set of them comes back. Where the others all but decide the bound, nothing moves
    until one of them is dropped.

    Args:
        steps: systems with other bounds that are solved at most; as many may be broken at first.
        x: result (n,).

    Returns:
        how many rows G has in the end, or UNSETTLED, and how many steps it took.
    """
    taken, active, push, row = solver.taken, solver.active, solver.push, -1
    base, tolerance = solver.sizes[BASE], solver.tolerance[0]
    for j in range(len(x)):
        solver.inverse[j] = 1.0 / solver.diagonal[j]
        solver.free[j] = solver.inverse[j] * solver.pull[j]
    size, fresh, exact, step = _begin(solver, steps, x), True, True, 0
    if size < 0:
        return UNSETTLED, step
    for step in range(steps + 1):
        if fresh:
            allowed = tolerance if exact else 0.5 * tolerance
            row, side, count = _most_violated(solver, allowed, x)
            if row < 0:
                if exact or _meet_rows(solver, size, size, x):
                    copy_to(x, solver.last)
                    return size, step
                break
            hopeless = step == 0 and count > steps
            if hopeless or step == steps or size == len(solver.right):
                break
            known, taken[row], active[size - base], push[size - base] = size, side, row, 0.0
            size = _place_bound(solver, size, row)
        met = _try_rows(solver, known, size, solver.trial, base)
        if fresh and not (met or exact):  # what the others decide may be beyond by their rounding
            taken[row], size, exact = 0, size - 1, True
            if _meet_rows(solver, size, size, x):
                continue
            break
        leaving = _go_on(solver, size, met)
        fresh = leaving < 0
        if fresh:
            if not met:
                break
            exact = False
            copy_to(solver.trial, x)
        else:
            known = size if met else size - 1
            _let_go(solver, size, known, leaving)
            known, size = known - 1, size - 1
    taken[:] = 0
    return UNSETTLED, step


@compiled
def keep_hopeful(solver: SolverMemory) -> bool:
    """Let go of all bounds where the last solution breaks more than FEW; return if any is left.

    To try them costs 25 us with Talos. Of its hostile ticks in which a try fails five in six are
    told by this, and of those in which one succeeds one in forty.

    """
    taken, solver.sizes[START] = solver.taken, 0
    if not taken.any():
        return False
    hopeful = _most_violated(solver, solver.tolerance[0], solver.last)[2] <= FEW
    if not hopeful:
        taken[:] = 0
    return bool(hopeful)
