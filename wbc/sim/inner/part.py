"""One smooth part of a step from its middle on: forces, barriers, gear rows, program, new state."""

from __future__ import annotations

from typing import NamedTuple

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
    compiled,
    group,
    local,
    several,
)
from wbc.sim.inner.arrival import arrive
from wbc.sim.inner.barriers import held_rows, world_pushes
from wbc.sim.inner.motion import to_middle
from wbc.sim.inner.program import free_velocity, gear_laws, solve_rows
from wbc.sim.inner.tables import (
    ACCURACY,
    FIRST,
    FLIGHT,
    JOINT,
    OPENED,
    PLACED,
    PLANAR,
    TOUCH,
    TREE,
    Flight,
    Opened,
    PlacedTree,
    opened,
)
from wbc.sim.step.momentum import part_on_joints
from wbc.sim.tree.inertia import bias_at
from wbc.sim.tree.tree import Tree


class Acting(NamedTuple):
    """What acts on a plant in one part of a step.

    Attributes:
        before: (2 j + c,) barriers closed at the start.
        kept: (2 j + c,) barriers that may close within the part.
        stored: row impulses of the last step in the plant's layout; empty for none.
        v: (nv,) at the start.
        torque: (m,) on the rotors.
        force: (nv,) from effects and from outside.
        dry: (m,) level of dry friction at the gears' joints.
        step: h [s].
    """

    before: BoolArray
    kept: BoolArray
    stored: FloatArray
    v: FloatArray
    torque: FloatArray
    force: FloatArray
    dry: FloatArray
    step: float


ACTING = group(Acting, Flags, Flags, Row, Row, Row, Row, Row, Number)
MIDDLE = several(OutRow, OutRow, OutRow)
FAILED, SMOOTH, LANDED = range(3)
"""No solution by Newton; a part to the end; one in which a barrier was passed on the way."""


@compiled(MIDDLE, OutRow, OutPlaces)
def middle_of(out: FloatArray, ends: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q (nq,), v (nv,) of the middle and the rates (2 j + c,) of the start within `out`."""
    return out[ends[9] : ends[10]], out[ends[10] : ends[11]], out[ends[11] : ends[12]]


@compiled(Nothing, TREE, FLIGHT, PLACED, Row, OutRow, counted=False)
def bias_of(
    tree: Tree, flight: Flight, placed: PlacedTree, v: FloatArray, bias: FloatArray
) -> None:
    """Write gravity and the velocity terms (nv,), less those that the momentum accounts for."""
    bias_at(tree.joints, tree.rows, tree.gravity, placed.columns, placed.bodies, v, bias)
    bases, weight = flight.bases, local(3)
    for i in range(len(bases)):
        turn, lever = flight.frames[i, :9].reshape(3, 3), flight.frames[i, 9:]
        for k in range(3):
            weight[k] = -placed.composite[bases[i, JOINT], 0] * tree.gravity[k]
        first, planar = bases[i, FIRST], bases[i, PLANAR] == 1
        part_on_joints(placed.inertia, turn, lever, first, planar, weight, bias)


@compiled(Nothing, Count, Count, Count, Count, Count, Flags, OutPlaces, counted=False)
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


@compiled(several(Count, Count), Flags, Flags, Count, OutFlags, counted=False)
def count_closed(
    before: BoolArray, kept: BoolArray, limits: int, closed: BoolArray
) -> tuple[int, int]:
    """Write which barriers hold in a part; return how many limits and how many contacts do."""
    held, touching = 0, 0
    for i in range(len(closed)):
        closed[i] = before[i] or kept[i]
        if closed[i]:
            held, touching = held + (i < limits), touching + (i >= limits)
    return held, touching


@compiled(Nothing, OPENED, ACTING, OutDense, OutDense, counted=False)
def gear_rows_of(plant: Opened, acting: Acting, laws: FloatArray, matrix: FloatArray) -> None:
    """Write the laws (m, 9) of the gears, and their rows as the first m of `matrix` (r, nv)."""
    gears = plant.gears
    gear_laws(gears.numbers, gears.rows, acting.v, acting.torque, acting.dry, acting.step, laws)
    for i in range(len(gears.rows)):
        for c in range(len(acting.v)):
            matrix[i, c] = gears.rows[i, c]


@compiled(Nothing, Places, Row, Row, Dense, OutRow, OutRow, OutRow, counted=False)
def write_rows(
    places: IntArray,
    solved: FloatArray,
    moved: FloatArray,
    laws: FloatArray,
    impulse: FloatArray,
    motor: FloatArray,
    mesh: FloatArray,
) -> None:
    """Write what rows with impulses and speeds (r,) leave behind.

    Args:
        places: (r,) see `row_places`.
        solved, moved: (r,) impulses and speeds.
        laws: (m, 9) of the gears.
        impulse: of all rows that there may be, to write.
        motor: (m,) speeds of the motor outputs, to write.
        mesh: (m,) T, to write.
    """
    impulse[:] = 0.0
    for i in range(len(places)):
        impulse[places[i]] = solved[i]
    for i in range(len(laws)):
        motor[i] = moved[i]
        mesh[i] = solved[i] + np.sign(moved[i]) * laws[i, 5]


@compiled(Count, Row, Row, Number, OutFlags, counted=False)
def hold_or_land(pushes: FloatArray, gap: FloatArray, touch: float, closed: BoolArray) -> int:
    """Write which barriers stay closed, pressed ones or in touch; return LANDED or SMOOTH.

    Args:
        pushes: (l + k,) impulses of the closed limits and normals.
        gap: (2 j + c,) at the end.
        touch: gap up to which a barrier counts as closed; one that is passed by more has landed.
        closed: (2 j + c,) to change.
    """
    result, row = SMOOTH, 0
    for i in range(len(gap)):
        if closed[i]:
            closed[i] = gap[i] <= touch or pushes[row] > 0.0
            row += 1
        elif gap[i] < -touch:
            result = LANDED
    return result


@compiled(Count, OPENED, ACTING, OutRow, OutFlags)
def from_middle(plant: Opened, acting: Acting, out: FloatArray, closed: BoolArray) -> int:
    """Write the end of a smooth part from its middle, where the memory stands.

    Args:
        plant: what moves, and its memory, with which `to_middle` stands at the middle.
        acting: what acts on it.
        out: what `Ended` holds, one after the other: the middle to read, the rest to write.
        closed: (2 j + c,) barriers that stay closed, to write.

    Returns:
        FAILED, SMOOTH or LANDED; and minus SMOOTH or LANDED where some overlap is left.
    """
    kept, step, obstacles, ends = acting.kept, acting.step, plant.obstacles, plant.ends
    tree, bases, placed = plant.tree, plant.flight.bases, plant.placed
    q_end, v_end, motor = out[: ends[0]], out[ends[0] : ends[1]], out[ends[1] : ends[2]]
    impulse, gap, after = out[ends[2] : ends[3]], out[ends[3] : ends[4]], out[ends[4] : ends[5]]
    mesh, overlap = out[ends[5] : ends[6]], out[ends[6] : ends[7]]
    contact_impulse = out[ends[7] : ends[8]].reshape(-1, 3)
    middle, speed, rate = middle_of(out, ends)
    n, m, j, d = len(acting.v), len(plant.gears.rows), len(obstacles.limit_at), obstacles.tangents
    # Forces.
    bias, free, lower = np.empty(n), np.empty(n), np.empty((n, n))
    bias_of(tree, plant.flight, placed, speed, bias)
    for i in range(n):
        bias[i] = acting.force[i] - bias[i]
    if not free_velocity(placed.inertia, speed, bias, step, free, lower):
        return FAILED
    # Barriers.
    limits, touching = count_closed(acting.before, kept, 2 * j, closed)
    both = limits + touching
    total = m + both + d * touching
    matrix, axes = np.empty((total, n)), np.empty((touching * (1 + d), 3))
    which = np.empty(touching, dtype=np.int64)
    targets, frictions = np.empty(both), np.empty(touching)
    held_rows(
        closed, kept, rate, speed, step, obstacles, tree.rows, bases, placed, middle, m, matrix,
        axes, which, targets, frictions, gap,
    )  # fmt: skip
    # Gear rows.
    laws = np.empty((m, 9))
    gear_rows_of(plant, acting, laws, matrix)
    # Program and solution.
    places = np.empty(total, dtype=np.int64)
    row_places(m, n, len(closed), 2 * j, d, closed, places)
    start, solved, moved = np.zeros(total), np.zeros(total), np.zeros(total)
    if len(acting.stored) == len(impulse):
        for i in range(total):
            start[i] = acting.stored[places[i]]
    accuracy = plant.bounds[ACCURACY]
    used = solve_rows(
        matrix, lower, laws, targets, frictions, d, free, start, accuracy, solved, moved, after
    )
    if used < 0:
        return FAILED
    out[ends[8]] = used
    write_rows(places, solved, moved, laws, impulse, motor, mesh)
    world_pushes(solved[m + limits :], axes, which, d, contact_impulse)
    # New state.
    left = arrive(
        plant, closed, matrix[m : m + both], solved[m : m + both], middle, after, step, q_end,
        v_end, gap, overlap,
    )  # fmt: skip
    result = hold_or_land(solved[m : m + both], gap, plant.bounds[TOUCH], closed)
    return -result if left else result


@compiled(Nothing, OutPlaces, OutRow, Row, Row, Number, Flags, OutRow, counted=False)
def first_half(
    whole: IntArray,
    numbers: FloatArray,
    q: FloatArray,
    v: FloatArray,
    half: float,
    closed: BoolArray,
    out: FloatArray,
) -> None:
    """Write the middle of a part into `out`, see `to_middle`; the plant as by `packed_plant`."""
    plant = opened(whole, numbers)
    middle, speed, rate = middle_of(out, plant.ends)
    to_middle(
        plant.tree, plant.flight, plant.obstacles, plant.placed, q, v, half, closed, middle, speed,
        rate,
    )  # fmt: skip


@compiled(
    Count, OutPlaces, OutRow, Flags, Flags, Row, Row, Row, Row, Row, Row, Number, Flag, OutRow,
    OutFlags, counted=False,
)  # fmt: skip
def part_of_step(
    whole: IntArray,
    numbers: FloatArray,
    before: BoolArray,
    kept: BoolArray,
    stored: FloatArray,
    q: FloatArray,
    v: FloatArray,
    torque: FloatArray,
    force: FloatArray,
    dry: FloatArray,
    step: float,
    begun: bool,
    out: FloatArray,
    closed: BoolArray,
) -> int:
    """Do both halves from q (nq,), or the second where `first_half` has `begun`.

    The plant is as by `packed_plant`; see `Acting` and `from_middle` for the rest.
    """
    plant = opened(whole, numbers)
    middle, speed, rate = middle_of(out, plant.ends)
    if not begun:
        to_middle(
            plant.tree, plant.flight, plant.obstacles, plant.placed, q, v, 0.5 * step, before,
            middle, speed, rate,
        )  # fmt: skip
    acting = Acting(before, kept, stored, v, torque, force, dry, step)
    return from_middle(plant, acting, out, closed)
