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
from wbc.sim.inner.arrival import arrive
from wbc.sim.inner.barriers import held_rows, world_pushes
from wbc.sim.inner.motion import (
    FIRST,
    JOINT,
    PLANAR,
    base_frame,
    point_of_reference,
)
from wbc.sim.inner.program import free_velocity, gear_laws, solve_rows
from wbc.sim.step.momentum import part_on_joints
from wbc.sim.tree.inertia import bias_at

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
    OutDense, OutDense, OutDense, OutDense, OutDense, OutDense, OutRow, OutRow, Row,
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
    rate: FloatArray,
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
        rate: (2 j + c,) speed at which closed contacts opened at the start.
        out: what `Ended` holds, one after the other, to write.
        ends: where each of these ends.
        closed: (2 j + c,) barriers that stay closed, to write.

    Returns:
        FAILED, SMOOTH or LANDED; and minus SMOOTH or LANDED where some overlap is left.
    """
    n, m, j = len(v), len(gears), len(limit_at)
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
    targets, frictions = np.empty(both), np.empty(touching)
    point_of_reference(bases, poses, about)
    held_rows(
        closed, kept, rate, speed, step, limit_at, limit_range, contact_at, contacts, solids,
        planar, rows, columns, about, poses, middle, m, matrix, axes, which, targets, frictions,
        gap,
    )  # fmt: skip
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
    world_pushes(solved[m + limits :], axes, which, d, contact_impulse)
    # New state.
    left = arrive(
        joints, shapes, rows, bases, limit_at, limit_range, contact_at, contacts, solids, gears,
        gear_rows, closed, matrix[m : m + both], solved[m : m + both], middle, after, step,
        return_speed, drift_from, touch, poses, columns, bodies, composite, inertia, carried,
        q_end, v_end, gap, overlap,
    )  # fmt: skip
    result, row = SMOOTH, 0
    for i in range(size):
        if closed[i]:
            closed[i] = gap[i] <= touch or solved[m + row] > 0.0
            row += 1
        elif gap[i] < -touch:
            result = LANDED
    return -result if left else result
