"""One smooth part of a step from its middle on: forces, barriers, gear rows, program, new state."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Flags,
    Nothing,
    Number,
    OutDense,
    OutFlags,
    OutPlaces,
    OutRow,
    Places,
    Row,
    Table,
    compiled,
)
from wbc.sim.inner.barriers import barrier_rows, gaps_at
from wbc.sim.inner.motion import (
    FIRST,
    JOINT,
    PLANAR,
    advance,
    base_frame,
    look,
    point_of_reference,
    set_momentum,
)
from wbc.sim.inner.program import INERTIA, free_velocity, gear_laws, solve_rows
from wbc.sim.solve.linear import factor_inertia, halfway, products, rest_of_way
from wbc.sim.step.momentum import momentum_at, part_on_joints
from wbc.sim.step.overlap import least
from wbc.sim.tree.inertia import bias_at
from wbc.sim.tree.kinematics import moved_along, place

FAILED, SMOOTH, LANDED = range(3)
"""No solution by Newton; a part to the end; one in which a barrier was passed on the way."""


@compiled(Nothing, Table, Table, Row, Table, Dense, Dense, Dense, Dense, Dense, Row, OutRow)
def bias_of(
    joints: IntArray,
    rows: IntArray,
    gravity: FloatArray,
    bases: IntArray,
    poses: FloatArray,
    columns: FloatArray,
    bodies: FloatArray,
    composite: FloatArray,
    inertia: FloatArray,
    v: FloatArray,
    bias: FloatArray,
) -> None:
    """Write gravity and the velocity terms (nv,), less those that the momentum accounts for."""
    bias_at(joints, rows, gravity, columns, bodies, v, bias)
    turn, lever, weight = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(len(bases)):
        base_frame(bases, i, poses, composite, turn, lever)
        for k in range(3):
            weight[k] = -composite[bases[i, JOINT], 0] * gravity[k]
        planar = bases[i, PLANAR] == 1
        part_on_joints(inertia, turn, lever, bases[i, FIRST], planar, weight, bias)


@compiled(Flag, Dense, Dense, Dense, Dense, Flags, Row, Number, OutRow)
def shift_of(
    inertia: FloatArray,
    gear_rows: FloatArray,
    gears: FloatArray,
    matrix: FloatArray,
    pressed: BoolArray,
    gap: FloatArray,
    furthest: float,
    shift: FloatArray,
) -> bool:
    """Write the least shift (nv,) that takes overlaps back; False where none can be found.

    Args:
        inertia: H_l; rotors are added, so that what is light moves first.
        gear_rows, gears: of the rotors.
        matrix: (b, nv) rows of the closed limits and normals.
        pressed: (b,) whether they carry an impulse: their gaps are taken back from either side.
        gap: (b,) of these; a gap that is left may close.
        furthest: [m, rad] by which an overlap is taken back at most.
        shift: to write.
    """
    n, count = len(shift), len(gap)
    metric, lower = np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            metric[i, j] = inertia[i, j]
    for g in range(len(gears)):
        for i in range(n):
            if gear_rows[g, i] != 0.0:
                for j in range(n):
                    metric[i, j] += gears[g, INERTIA] * gear_rows[g, i] * gear_rows[g, j]
    if not factor_inertia(metric, lower):
        return False
    half, delassus = np.empty((n, count)), np.empty((count, count))
    missing, lowest, push = np.empty(count), np.empty(count), np.zeros(count)
    for i in range(count):
        for j in range(n):
            half[j, i] = matrix[i, j]
    halfway(lower, half)
    products(half, delassus)
    for i in range(count):
        missing[i], lowest[i] = min(-gap[i], furthest), 0.0
        if pressed[i]:
            missing[i], lowest[i] = max(missing[i], -furthest), -np.inf
    least(delassus, missing, lowest, push)
    for j in range(n):
        shift[j] = 0.0
        for i in range(count):
            shift[j] += half[j, i] * push[i]
    rest_of_way(lower, shift)
    return True


@compiled(Nothing, Count, Count, Count, Count, Count, Flags, OutPlaces)
def row_places(
    gears: int,
    coordinates: int,
    barriers: int,
    limits: int,
    tangents: int,
    closed: BoolArray,
    places: IntArray,
) -> None:
    """Write where each row of a part sits in `SimState.impulse`, see `ImpulseLayout`."""
    row, first = gears, gears + coordinates
    for i in range(gears):
        places[i] = i
    for i in range(barriers):
        if closed[i]:
            places[row] = first + i
            row += 1
    for i in range(limits, barriers):
        if closed[i]:
            for a in range(tangents):
                places[row] = first + barriers + (i - limits) * tangents + a
                row += 1


@compiled(
    Count,
    Table, Dense, Table, Row, Table,
    Table, Dense, Table, Dense, Dense, Flag,
    Dense, Dense,
    Flags, Flags, Row, Row, Row, Row, Row, Number, Number, Number, Number, Number,
    OutDense, OutDense, OutDense, OutDense, OutDense, OutDense, OutRow, OutRow,
    OutRow, Places, OutFlags,
)  # fmt: skip
def from_middle(
    joints: IntArray,
    shapes: FloatArray,
    rows: IntArray,
    gravity: FloatArray,
    bases: IntArray,
    limit_at: IntArray,
    limit_range: FloatArray,
    contact_at: IntArray,
    contacts: FloatArray,
    solids: FloatArray,
    planar: bool,
    gears: FloatArray,
    gear_rows: FloatArray,
    before: BoolArray,
    kept: BoolArray,
    stored: FloatArray,
    v: FloatArray,
    torque: FloatArray,
    force: FloatArray,
    dry: FloatArray,
    step: float,
    return_speed: float,
    accuracy: float,
    drift_from: float,
    touch: float,
    poses: FloatArray,
    columns: FloatArray,
    bodies: FloatArray,
    composite: FloatArray,
    inertia: FloatArray,
    carried: FloatArray,
    middle: FloatArray,
    speed: FloatArray,
    out: FloatArray,
    ends: IntArray,
    closed: BoolArray,
) -> int:
    """Write the end of a smooth part from its middle, where the memory stands.

    Args:
        joints, shapes, rows, gravity: of the `Tree`.
        bases: table of free bases (`motion`).
        limit_at, limit_range, contact_at, contacts, solids: see `gaps_at`.
        planar: whether contact points move in x-z only.
        gears: table of gears (`program`).
        gear_rows: (m, nv).
        before: (2 j + c,) barriers closed at the start.
        kept: (2 j + c,) barriers that may close within the part.
        stored: row impulses of the last step in the plant's layout; empty for none.
        v: (nv,) at the start.
        torque: (m,) on the rotors.
        force: (nv,) from effects and from outside.
        dry: (m,) level of dry friction at the gears' joints.
        step: h [s].
        return_speed: at which an overlap is taken back at most.
        accuracy: of the solution.
        drift_from: overlap from which on it is taken back.
        touch: gap up to which a barrier counts as closed.
        poses, columns, bodies, composite, inertia: memory of the tree, at the middle.
        carried: (b, 10) momentum of the start, centres of mass at the middle.
        middle: q (nq,) at the middle.
        speed: v (nv,) there, with the momentum of the start.
        out: what `Ended` holds, one after the other, to write.
        ends: where each of these ends.
        closed: (2 j + c,) barriers that stay closed, to write.

    Returns:
        FAILED, SMOOTH or LANDED; and minus SMOOTH or LANDED where some overlap is left.
    """
    n, m, j, k = len(v), len(gears), len(limit_at), len(contact_at)
    q_end, v_end, motor = out[: ends[0]], out[ends[0] : ends[1]], out[ends[1] : ends[2]]
    impulse, gap, after = out[ends[2] : ends[3]], out[ends[3] : ends[4]], out[ends[4] : ends[5]]
    mesh, overlap = out[ends[5] : ends[6]], out[ends[6] : ends[7]]
    contact_impulse = out[ends[7] : ends[8]].reshape(-1, 3)
    size, d = len(before), 1 if planar else 2
    # Forces.
    bias, free, lower = np.empty(n), np.empty(n), np.empty((n, n))
    bias_of(joints, rows, gravity, bases, poses, columns, bodies, composite, inertia, speed, bias)
    for i in range(n):
        bias[i] = force[i] - bias[i]
    if not free_velocity(inertia, speed, bias, step, free, lower):
        return FAILED
    # Barriers.
    limits, touching = 0, 0
    for i in range(size):
        closed[i] = before[i] or kept[i]
        if closed[i]:
            limits, touching = limits + (i < 2 * j), touching + (i >= 2 * j)
    both = limits + touching
    total = m + both + d * touching
    matrix, axes = np.empty((total, n)), np.empty((touching * (1 + d), 3))
    which, about = np.empty(touching, dtype=np.int64), np.empty(3)
    targets, frictions = np.zeros(both), np.empty(touching)
    point_of_reference(bases, poses, about)
    if both:
        gaps_at(limit_at, limit_range, contact_at, contacts, solids, middle, poses, gap)
        barrier_rows(
            closed, limit_at, contact_at, contacts, solids, planar, rows, columns, about, poses, m,
            matrix, axes, which,
        )  # fmt: skip
    row = 0
    for i in range(size):
        if closed[i]:
            # A barrier that was kept ahead of its closing may close, over the half step left.
            if kept[i]:
                targets[row] = -2.0 / step * max(gap[i], 0.0)
            row += 1
    for c in range(touching):
        frictions[c] = contacts[which[c] % k, 4]
    # Gear rows.
    laws = np.empty((m, 7))
    gear_laws(gears, gear_rows, v, torque, dry, step, laws)
    for i in range(m):
        for c in range(n):
            matrix[i, c] = gear_rows[i, c]
    # Program and solution.
    places = np.empty(total, dtype=np.int64)
    row_places(m, n, size, 2 * j, d, closed, places)
    start, solved, moved = np.zeros(total), np.zeros(total), np.zeros(total)
    if len(stored) == len(impulse):
        for i in range(total):
            start[i] = stored[places[i]]
    used = solve_rows(
        matrix, lower, laws, targets, frictions, d, free, start, accuracy, solved, moved, after
    )
    if used < 0:
        return FAILED
    out[ends[8]] = used
    impulse[:] = 0.0
    for i in range(total):
        impulse[places[i]] = solved[i]
    for i in range(m):
        motor[i] = moved[i]
        mesh[i] = solved[i] + np.sign(moved[i]) * laws[i, 5]
    contact_impulse[:] = 0.0
    for c in range(touching):
        for x in range(3):
            push = solved[m + limits + c] * axes[c * (1 + d), x]
            for a in range(d):
                push += solved[m + both + c * d + a] * axes[c * (1 + d) + 1 + a, x]
            contact_impulse[which[c] % k, x] += push
    # New state.
    turn, lever, half = np.empty((3, 3)), np.empty(3), 0.5 * step
    for i in range(len(bases)):
        base_frame(bases, i, poses, composite, turn, lever)
        momentum_at(
            inertia, turn, lever, bases[i, FIRST], bases[i, PLANAR] == 1, after, carried[i, :6]
        )
    moved_along(joints, middle, after, half, q_end)
    place(joints, shapes, q_end, poses)
    advance(joints, bases, shapes, half, carried, q_end, poses)
    gaps_at(limit_at, limit_range, contact_at, contacts, solids, q_end, poses, gap)
    pressed, drift = np.empty(both, dtype=np.bool_), np.empty(both)
    row, worst, deepest, left = 0, 0.0, 0.0, False
    for i in range(size):
        overlap[i] = 0.0
        if closed[i]:
            pressed[row], drift[row] = solved[m + row] > 0.0, gap[i]
            worst = max(worst, abs(gap[i]) if pressed[row] else -gap[i])
            deepest = min(deepest, gap[i])
            row += 1
    if worst > drift_from:
        furthest, shift = return_speed * step, np.empty(n)
        if deepest < -furthest - touch:
            left = True
            for i in range(size):
                overlap[i] = max(-gap[i] - furthest, 0.0) if closed[i] else 0.0
        if shift_of(
            inertia, gear_rows, gears, matrix[m : m + both], pressed, drift, furthest, shift
        ):
            moved_along(joints, q_end.copy(), shift, 1.0, q_end)
            place(joints, shapes, q_end, poses)
            gaps_at(limit_at, limit_range, contact_at, contacts, solids, q_end, poses, gap)
    v_end[:] = after
    if len(bases):
        upto = 0
        for i in range(len(bases)):
            upto = max(upto, bases[i, FIRST] + (3 if bases[i, PLANAR] == 1 else 6))
        look(joints, shapes, rows, bases, upto, poses, columns, bodies, composite, inertia)
        set_momentum(bases, poses, composite, inertia, carried, v_end)
    result, row = SMOOTH, 0
    for i in range(size):
        if closed[i]:
            closed[i] = gap[i] <= touch or pressed[row]
            row += 1
        elif gap[i] < -touch:
            result = LANDED
    return -result if left else result
