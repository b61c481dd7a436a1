"""Steps with self-locking gears (eta_b < 0): one solution, none or several, decided by solving.

A self-locking gear that turns against its rotor's momentum b has a tent for a law. Along its
direction, with T the impulse on the links and w the speed:

    high    T >= 0                  the motor drives: like any gear
    fall    -b/|eta_b| <= T <= 0    M w = b + |eta_b| T: the harder it is driven back, the slower
    low     T <= -b/|eta_b|         w = 0: locked

Where Lambda + diag(eta_b / M) is positive definite, with the compliance Lambda of all rows and the
second term at the falling ones, the whole step is strictly monotone and has one solution, whichever
of the other rows are rigid. Otherwise each of these gears is held to one of the three ranges at a
time: `high` and `low` are monotone laws, `fall` is a line. What solves the rest and lies in its
ranges solves the step. Where the ranges of the step before still hold, the motion goes on there.
Otherwise all are tried, and of several solutions the one is taken whose gears carry most nearly
what they did. Without a step before, several solutions are refused.

A gear that yields by more than |eta_b| / M has one solution in every step: none of those is held.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Places, Row, compiled, inner
from wbc.mechanics.linear import copy_to, dot, factor_inertia, products
from wbc.mechanics.memory import whole_of
from wbc.mechanics.newton import RANGES, SEVERAL, newton, proximal, residual, solve_laws, speeds_at
from wbc.mechanics.rows import RowSystem, copied

# [rad/s] below which two solutions count as one.
_SLOWEST = 1e-9

# Gears tried in all ranges: 3^6 of them.
_MOST = 6

_SYSTEMS = 300  # linear systems of proximal rounds for one choice of ranges
# Of the tolerance, from which on speeds are those of two solutions. With 10 and with 1e6 random
# steps (tests/sim/step), and jacks and legs on light rotors, have the same solutions.
_APART = 1e4
_HIGH, _FALL, _LOW = range(3)


@compiled(inside=True)
def undecided_rows(system: RowSystem) -> OutPlaces:
    """Return the falling rows (f,) if the step may have several solutions; none where it has one.

    A rigid row falls where the gear locks itself and brings an impulse along: from w = up/M down to
    rest. Any other row may be rigid in another solution (a gear that sticks, a point that holds):
    the compliance of the falling rows counts with all of them held, but for a billionth of their
    own.
    """
    size, count, rows = len(system.free), 0, whole_of(system.heap, len(system.laws))
    for i in range(len(rows)):
        law = system.laws[i]
        fast = max(law[0], -law[1]) > _SLOWEST * law[2]
        if law[4] < 0.0 and law[7] == np.inf and fast:
            rows[count], count = i, count + 1
    if count == 0:
        return rows[:0]
    total = np.empty((size, size))
    products(system.ways, total)
    for i in range(size):
        total[i, i] += 1e-9 * system.own[i]
    for i in rows[:count]:
        total[i, i] += system.laws[i, 4] / system.laws[i, 2]
    return rows[: 0 if factor_inertia(total, np.empty((size, size))) else count]


@inner
def range_of(law: Row, impulse: float) -> int:
    """Return the range of a falling row (9,) at an impulse."""
    up = law[0] > 0.0
    along, brought = (impulse, law[0]) if up else (-impulse, -law[1])
    if along + law[5] >= 0.0:
        return _HIGH
    return _LOW if along + law[5] < brought / law[4] else _FALL


@inner
def hold_to(law: OutRow, which: int) -> None:
    """Change the law (9,) of a falling row so that it holds one range, and goes on beyond it."""
    if which == _FALL:  # a spring that the row's speed winds up backwards
        law[7] = law[2] / law[4] + law[6]
        law[8] = law[0] / law[4] - law[5] if law[0] > 0.0 else law[1] / law[4] + law[5]
    if which != _HIGH:
        law[0], law[1] = -np.inf, np.inf
    law[4] = 0.0


@compiled(inside=True)
def try_ranges(system: RowSystem, held: RowSystem, start: Row, impulse: OutRow) -> tuple[int, bool]:
    """Write row impulses (r,) from a start; return linear systems, and if all laws are met.

    Args:
        system: of the step.
        held: the same with falling rows held to ranges, and a stricter tolerance.
        start: (r,).
        impulse: to write.
    """
    used = abs(newton(held, start, True, impulse))
    if not residual(held, impulse) <= system.tolerance:
        used += abs(proximal(held, start, _SYSTEMS, impulse))
    return used, residual(system, impulse) <= system.tolerance


@compiled(inside=True)
def is_new(system: RowSystem, impulse: Row, found: Dense) -> bool:
    """Return whether the speeds of row impulses (r,) are not those of solutions (s, r)."""
    x, speed, other = np.empty(system.ways.shape[1]), np.empty(len(impulse)), np.empty(len(impulse))
    speeds_at(system, impulse, x, speed)
    for s in range(len(found)):
        speeds_at(system, found[s], x, other)
        if np.max(np.abs(speed - other)) <= _APART * system.tolerance:
            return False
    return True


@compiled(inside=True)
def solve_in_ranges(
    system: RowSystem, rows: Places, start: Row, found: OutDense
) -> tuple[int, int]:
    """Write solutions (s, r) of a step, the first one that where its gears go on.

    Args:
        system: of the step.
        rows: (f,) its falling rows.
        start: row impulses (r,) of the step before, zeros for none.
        found: to write.

    Returns:
        the number of linear systems solved, and that of solutions: one where the ranges of the step
        before hold, none also where there are too many gears to try.
    """
    f, used, count, nearest, known = len(rows), 0, 0, np.inf, dot(start, start) > 0.0
    held = copied(system, 0.1 * system.tolerance)
    impulse, origins = np.zeros(len(start)), np.zeros((3, len(start)))
    laws, heap = held.laws, system.heap
    copy_to(start, origins[0])
    taken = heap.used[0]
    for choice in range(-1 if known else 0, 3**f if f <= _MOST else 0):
        rest = choice
        for i in rows:
            copy_to(system.laws[i], laws[i])
            before = range_of(laws[i], start[i])
            hold_to(laws[i], before if choice < 0 else rest % 3)
            origins[1, i] = 0.0
            if laws[i, 7] < 0.0:  # where the others carry nothing
                alone = 1.0 + laws[i, 7] * system.own[i]
                origins[1, i] = (laws[i, 8] - laws[i, 7] * system.free[i]) / alone
            rest //= 3
        for k in range(0 if known else 1, 3):
            heap.used[0] = taken
            copy_to(impulse, origins[2])
            more, good = try_ranges(system, held, origins[k], impulse)
            used, moved, same = used + more, 0.0, True
            for i in rows:
                moved = max(moved, abs(impulse[i] - start[i]))
                before = range_of(system.laws[i], start[i])
                same = same and range_of(system.laws[i], impulse[i]) == before
            if good and choice < 0 and same:
                copy_to(impulse, found[0])
                return used, 1
            if good and choice >= 0 and is_new(system, impulse, found[:count]):
                slot = min(count, len(found) - 1)
                at = 0 if moved < nearest else slot
                copy_to(found[at], found[slot])
                copy_to(impulse, found[at])
                nearest, count = min(nearest, moved), count + 1
    return used, count


@compiled(inside=True)
def solve_rows(system: RowSystem, start: Row, work: float, impulse: OutRow) -> tuple[int, int]:
    """Write the row impulses (r,) as `solve_laws` does, those of self-locking gears by ranges.

    Returns:
        what `solve_laws` does, or RANGES, or SEVERAL where they are refused.
    """
    rows = undecided_rows(system)
    if len(rows) == 0:
        return solve_laws(system, start, work, impulse)
    found = np.empty((2, len(start)))
    used, count = solve_in_ranges(system, rows, start, found)
    copy_to(found[0], impulse)
    return used, RANGES if count == 1 or (count and dot(start, start) > 0.0) else SEVERAL
