"""From the middle of a part to its end: half a step on, out of what was overrun."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.compiled import (
    Dense,
    Flag,
    Flags,
    Nothing,
    Number,
    OutRow,
    Row,
    compiled,
)
from wbc.sim.inner.barriers import gaps_at
from wbc.sim.inner.motion import advance, base_rows, carry, look, set_momentum
from wbc.sim.inner.program import INERTIA
from wbc.sim.inner.tables import (
    DRIFT_FROM,
    GEARS,
    OPENED,
    RETURN_SPEED,
    TOUCH,
    GearTables,
    Opened,
)
from wbc.sim.solve.linear import factor_inertia, halfway, products, rest_of_way
from wbc.sim.step.overlap import CORRECTIONS, least
from wbc.sim.tree.kinematics import moved_along, place


@compiled(Flag, Dense, GEARS, Dense, Flags, Row, OutRow)
def shift_of(
    inertia: FloatArray,
    gears: GearTables,
    matrix: FloatArray,
    pressed: BoolArray,
    missing: FloatArray,
    shift: FloatArray,
) -> bool:
    """Write the least shift (nv,) that takes overlaps back; False where none can be found.

    Args:
        inertia: H_l; rotors are added, so that what is light moves first.
        gears: of the rotors.
        matrix: (b, nv) rows of the closed limits and normals.
        pressed: (b,) whether they carry an impulse: their gaps are taken back from either side.
        missing: (b,) by which their gaps are to open, below zero where they may close.
        shift: to write.
    """
    n, count = len(shift), len(missing)
    metric, lower = np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            metric[i, j] = inertia[i, j]
    for g in range(len(gears.rows)):
        turning = gears.rows[g]
        for i in range(n):
            if turning[i] != 0.0:
                for j in range(n):
                    metric[i, j] += gears.numbers[g, INERTIA] * turning[i] * turning[j]
    if not factor_inertia(metric, lower):
        return False
    half, delassus = np.empty((n, count)), np.empty((count, count))
    lowest, push = np.empty(count), np.zeros(count)
    for i in range(count):
        for j in range(n):
            half[j, i] = matrix[i, j]
    halfway(lower, half)
    products(half, delassus)
    for i in range(count):
        lowest[i] = -np.inf if pressed[i] else 0.0
    least(delassus, missing, lowest, push)
    for j in range(n):
        shift[j] = 0.0
        for i in range(count):
            shift[j] += half[j, i] * push[i]
    rest_of_way(lower, shift)
    return True


@compiled(Nothing, OPENED, Flags, Dense, Flags, Row, Number, OutRow, OutRow)
def take_back(
    plant: Opened,
    closed: BoolArray,
    matrix: FloatArray,
    pressed: BoolArray,
    drift: FloatArray,
    furthest: float,
    q: FloatArray,
    gap: FloatArray,
) -> None:
    """Move the robot out of overlaps, in a few shifts, see `CORRECTIONS`.

    Args:
        plant: its memory stands at q, but for `placed.inertia`: that is the middle's.
        closed: (2 j + c,).
        matrix: (b, nv) rows of the closed limits and normals in the middle.
        pressed: (b,) whether they carry an impulse.
        drift: (b,) their gaps.
        furthest: [m, rad] by which an overlap is taken back at most.
        q: (nq,) to change.
        gap: (2 j + c,) to change.
    """
    joints, shapes, poses = plant.tree.joints, plant.tree.shapes, plant.placed.poses
    count, off = len(drift), np.inf
    aim, missing, shift = np.empty(count), np.empty(count), np.empty(matrix.shape[1])
    last, gap_last = np.empty(len(q)), np.empty(len(gap))
    for i in range(count):
        nearer = max(-drift[i], -furthest) if pressed[i] else -drift[i]
        aim[i] = drift[i] + min(nearer, furthest)
        missing[i] = aim[i] - drift[i]
    for _ in range(CORRECTIONS):
        if not shift_of(plant.placed.inertia, plant.gears, matrix, pressed, missing, shift):
            return
        last[:], gap_last[:] = q, gap
        moved_along(joints, last, shift, 1.0, q)
        place(joints, shapes, q, poses)
        gaps_at(plant.obstacles, q, poses, gap)
        before, off, row = off, 0.0, 0
        for i in range(len(closed)):
            if closed[i]:
                missing[row] = aim[row] - gap[i]
                off = max(off, abs(missing[row]) if pressed[row] else missing[row])
                row += 1
        if not off < before:  # A shift that leads astray is undone.
            q[:], gap[:] = last, gap_last
            place(joints, shapes, q, poses)
            return
        if off <= plant.bounds[DRIFT_FROM]:
            return


@compiled(
    Flag, OPENED, Flags, Dense, Row, Row, Row, Number, OutRow, OutRow, OutRow, OutRow
)  # fmt: skip
def arrive(
    plant: Opened,
    closed: BoolArray,
    matrix: FloatArray,
    pushes: FloatArray,
    middle: FloatArray,
    after: FloatArray,
    step: float,
    q_end: FloatArray,
    v_end: FloatArray,
    gap: FloatArray,
    overlap: FloatArray,
) -> bool:
    """Write position, velocity, gaps and overlaps at the end of a part; True where some is left.

    Args:
        plant: its memory stands at the middle, and afterwards at the end.
        closed: (2 j + c,).
        matrix: (l + k, nv) rows of the closed limits and normals.
        pushes: (l + k,) their impulses.
        middle: q (nq,) at the middle.
        after: v (nv,) there, after forces and impulses.
        step: h [s].
        q_end: (nq,) to write.
        v_end: (nv,) to write, with the momentum that `after` has in the middle.
        gap: (2 j + c,) to write.
        overlap: (2 j + c,) beyond what is taken back, to write.
    """
    joints, shapes, poses = plant.tree.joints, plant.tree.shapes, plant.placed.poses
    half, bases = 0.5 * step, plant.flight.bases
    carry(plant.flight, plant.placed, after)
    moved_along(joints, middle, after, half, q_end)
    place(joints, shapes, q_end, poses)
    advance(plant.tree, plant.flight, half, q_end, poses)
    gaps_at(plant.obstacles, q_end, poses, gap)
    pressed, drift = np.empty(len(pushes), dtype=np.bool_), np.empty(len(pushes))
    row, off, deepest, left = 0, 0.0, 0.0, False
    for i in range(len(closed)):
        overlap[i] = 0.0
        if closed[i]:
            pressed[row], drift[row] = pushes[row] > 0.0, gap[i]
            off = max(off, abs(gap[i]) if pressed[row] else -gap[i])
            deepest = min(deepest, gap[i])
            row += 1
    if off > plant.bounds[DRIFT_FROM]:
        furthest = plant.bounds[RETURN_SPEED] * step
        if deepest < -furthest - plant.bounds[TOUCH]:
            left = True
            for i in range(len(closed)):
                overlap[i] = max(-gap[i] - furthest, 0.0) if closed[i] else 0.0
        take_back(plant, closed, matrix, pressed, drift, furthest, q_end, gap)
    v_end[:] = after
    if len(bases):
        look(plant.tree, plant.flight, base_rows(bases), plant.placed)
        set_momentum(plant.flight, plant.placed, v_end)
    return left
