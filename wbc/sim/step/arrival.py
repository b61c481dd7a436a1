"""From the middle of a part to its end: half a step on, out of what was overrun.

What a barrier is overrun by (drift of a part of a step, or a ground whose gap jumps) is a matter of
place. Were it taken back by a speed, the robot would leave with that speed: the robot is moved out,
its velocity stays.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutRow, Places, Row, compiled, inner
from wbc.mechanics.kinematics import moved_along
from wbc.mechanics.linear import (
    add_all,
    add_times,
    copy_to,
    dot,
    factor,
    factor_inertia,
    halfway,
    products,
    rest_of_way,
    solve_factored,
)
from wbc.mechanics.memory import whole_of, zeros_of
from wbc.sim.step.contacts import NEAR, barrier_rows, gaps_at, gaps_of, other_place, put
from wbc.sim.step.motion import advance, carry, look, set_momentum, weigh
from wbc.sim.step.pairs import FAR
from wbc.sim.step.part_rows import PartRows
from wbc.sim.step.tables import RETURN_SPEED, TOUCH, Opened

DRIFT = 1e-8
"""Overlap, or gap of a barrier that is pressed, [m, rad] from which on it is taken back."""

_CORRECTIONS = 10
"""Most shifts along the rows of the middle that take an overlap back. Gaps are not linear in the
shift: after steps of 20 ms one shift left up to 0.1 mm. Of 614 corrections in 60 soft scenes of
519 steps of random scenes took one shift, 81 two, 11 three and 3 four."""

_HAIR, _SOFT = 1e-9, 1e-3
"""Compliance, as a share of its own, of a barrier that pushes (it chooses among equal pushes), and
of one that pulls. Two places of a box 2 mm apart on a field, one 2e-6 m open and one 3e-6 m deep,
took a shift of 0.7 mm when both were met exactly, which lifted the box by 0.01 J.
"""
_SWEEPS = 100
_TRIES = 100


@compiled(inside=True)
def least(delassus: Dense, pressed: Places, missing: Row, push: OutRow) -> None:
    """Write the pushes (b,) that open gaps by what is missing: delassus @ push >= missing.

    Only pressed ones pull, and softly: rows of places that are near to each other are nearly the
    same, and to meet what each of them lacks exactly would take a shift a thousand times as long.
    One linear solve where its signs are right, else sweeps (Gauss-Seidel).
    """
    size, most, right = len(missing), 0.0, True
    total, pivots = delassus.copy(), np.empty(size, dtype=np.int64)
    for i in range(size):
        push[i], most = missing[i], max(most, abs(missing[i]))
        right = right and pressed[i] > 0
        total[i, i] *= 1.0 + (_HAIR if missing[i] >= 0.0 else _SOFT)
    if right and factor(total, pivots):
        solve_factored(total, pivots, push)
        for i in range(size):
            right = right and push[i] * missing[i] >= 0.0
        if right:
            return
    push[:] = 0.0
    for _ in range(_SWEEPS):
        worst = 0.0
        for i in range(size):
            if delassus[i, i] <= 0.0:
                continue
            aim = push[i] + (missing[i] - dot(push, delassus[i])) / delassus[i, i]
            if aim < 0.0:
                aim = aim / (1.0 + _SOFT) if pressed[i] > 0 else 0.0
            worst = max(worst, abs(aim - push[i]) * delassus[i, i])
            push[i] = aim
        if worst <= 1e-6 * most:
            return


@compiled(inside=True)
def shift_of(metric: Dense, matrix: Dense, pressed: Places, missing: Row, shift: OutRow) -> bool:
    """Write the least shift (nv,) that takes overlaps back; False where none can be found.

    Args:
        metric: (nv, nv) in which it is least.
        matrix: (b, nv) rows of the closed limits and normals.
        pressed: (b,) one where they carry an impulse: their gaps are taken back from either side.
        missing: (b,) by which their gaps are to open, below zero where they may close.
        shift: to write.
    """
    n, count = len(shift), len(missing)
    lower = np.empty((n, n))
    if not factor_inertia(metric, lower):
        return False
    ways, delassus, push = matrix.copy(), np.empty((count, count)), np.empty(count)
    for i in range(count):
        halfway(lower, ways[i])
    products(ways, delassus)
    least(delassus, pressed, missing, push)
    shift[:] = 0.0
    add_all(push, ways, shift)
    rest_of_way(lower, shift)
    return True


@compiled(inside=True)
def take_back(plant: Opened, rows: PartRows, pressed: Places, drift: Row, furthest: float) -> None:
    """Move the robot out of overlaps, in a few shifts, see `_CORRECTIONS`.

    Their size is measured with the rotors of rigid gears: what is light moves first.

    Args:
        plant: its memory stands at the end, but for `placed.inertia`: that is the middle's.
            Position, gaps and shift of the end are changed.
        rows: of the part.
        pressed: (b,) one where its closed limits and normals carry an impulse.
        drift: (b,) their gaps.
        furthest: [m, rad] by which an overlap is taken back at most.
    """
    q, gap, gears = plant.end.position, plant.end.gap, plant.gears
    count, off, n = len(drift), 0.0, rows.matrix.shape[1]
    matrix = rows.matrix[len(rows.laws) : len(rows.laws) + count]
    aim, missing, shift = np.empty(count), np.empty(count), np.empty(n)
    last, gap_last, metric = np.empty(len(q)), np.empty(len(gap)), plant.placed.inertia.copy()
    for g in range(len(gears.rows)):
        turning = gears.rows[g]
        for i in range(0 if gears.yields[g] else n):
            if turning[i] != 0.0:
                add_times(gears.inertia[g] * turning[i], turning, metric[i])
    for i in range(count):
        nearer = max(-drift[i], -furthest) if pressed[i] > 0 else -drift[i]
        aim[i] = drift[i] + min(nearer, furthest)
        missing[i] = aim[i] - drift[i]
        off = max(off, abs(missing[i]) if pressed[i] > 0 else missing[i])
    for _ in range(_CORRECTIONS):
        if not shift_of(metric, matrix, pressed, missing, shift):
            return
        copy_to(q, last)
        copy_to(gap, gap_last)
        moved_along(plant.tree.joints, last, shift, 1.0, q)
        gaps_of(plant, q, gap)
        before, off = off, 0.0
        for row in range(count):
            i = rows.held[row]
            missing[row] = aim[row] - gap[i] if i < plant.obstacles.rigid else -FAR
            off = max(off, abs(missing[row]) if pressed[row] > 0 else missing[row])
        if not off < before:  # Ground with edges: a shift that leads astray is undone.
            copy_to(last, q)
            copy_to(gap_last, gap)
            put(plant, q)
            return
        add_times(1.0, shift, plant.end.moved)
        if off <= DRIFT or off > 0.5 * before:
            return


@inner
def arrive(plant: Opened, rows: PartRows, pushes: Row) -> None:
    """Write the end of a part.

    These are position, velocity (with the momentum that it has in the middle), gaps, the shift out
    of overlaps, and overlaps beyond what is taken back. Compliant barriers do not drift.

    Args:
        plant: its memory stands at the middle, and afterwards at the end.
        rows: of the part.
        pushes: (l + k,) impulses of the closed limits and normals.
    """
    end, half, held, off, deepest = plant.end, 0.5 * rows.step, rows.held, 0.0, 0.0
    carry(plant, end.after)
    moved_along(plant.tree.joints, end.before, end.after, half, end.position)
    put(plant, end.position)
    advance(plant, half, end.position)
    gaps_at(plant, end.position, end.closed[:0], end.gap)
    pressed, drift = whole_of(plant.heap, len(held)), zeros_of(plant.heap, len(held))
    jumped, rigid = other_place(plant, rows.step), plant.obstacles.rigid
    for row in range(len(held)):
        gap = end.gap[held[row]] if held[row] < rigid else 0.0
        drift[row], pressed[row] = gap, int(pushes[row] > 0.0 and gap < jumped)
        off, deepest = max(off, abs(gap) if pressed[row] > 0 else -gap), min(deepest, gap)
    end.moved[:], end.deepest[:] = 0.0, 0.0
    if off > DRIFT:
        furthest = plant.bounds[RETURN_SPEED] * rows.step
        for row in range(len(held) if deepest < -furthest - TOUCH else 0):
            if -drift[row] - furthest > end.deepest[0]:
                end.deepest[0], end.deepest[1] = -drift[row] - furthest, held[row]
        take_back(plant, rows, pressed, drift, furthest)
    copy_to(end.after, end.velocity)
    if len(plant.placed.bases):
        look(plant)
        set_momentum(plant, end.velocity)


@compiled
def lift(plant: Opened, stiff: Row, q: OutRow, gap: OutRow) -> bool:
    """Move q (nq,) out of the ground; False where no motion does it.

    Args:
        plant: what is moved.
        stiff: (nv,) ones for coordinates that keep still where others can do it.
        q: to change.
        gap: (2 j + c,) at the start, to write.
    """
    n, size = len(stiff), len(gap)
    here, start, shift, last = np.empty(size), q.copy(), np.empty(n), np.empty(len(q))
    for turn in range(_TRIES):
        gaps_of(plant, q, here)
        if turn == 0:
            copy_to(here, gap)
        near, count, touching, deepest = np.empty(size, dtype=np.int64), 0, 0, 0.0
        for i in range(size):
            deepest = min(deepest, here[i])
            if here[i] < NEAR:
                near[count], count = i, count + 1
                touching += i >= plant.obstacles.limits
        if deepest >= -0.5 * TOUCH:
            return True
        weigh(plant)
        matrix, axes = np.empty((count + 2 * touching, n)), np.empty((touching * 3, 3))
        barrier_rows(plant, near[:count], 0, matrix, axes)
        metric, most = plant.placed.inertia.copy(), 0.0
        for i in range(n):
            most = max(most, metric[i, i])
        for i in range(n):
            metric[i, i] += 1e6 * most * stiff[i]
        copy_to(q, last)
        free, missing = np.zeros(count, dtype=np.int64), np.empty(count)
        for row in range(count):
            missing[row] = min(-here[near[row]], NEAR)
        if not shift_of(metric, matrix[:count], free, missing, shift):
            return False
        moved_along(plant.tree.joints, last, shift, 1.0, q)
    copy_to(start, q)
    return False
