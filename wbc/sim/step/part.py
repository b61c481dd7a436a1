"""One smooth part of a step: both halves, and the rows between them (see `part_rows`).

Over a step the forces change the momentum of the whole tree, not the coordinates in which its base
happens to be described: p' = p + h (weight + outer forces), and the same for the angular momentum
about the centre of mass. A smooth part of a step therefore takes linear and angular momentum from
its start, finds the velocity that carries them at the middle, lets the forces and impulses change
them there, and finds the velocity that carries the result at the end. The centre of mass moves in
a straight line over each half. In free flight both momenta are exact to rounding, for any step,
any base frame and any motion of the joints; what is left of the Coriolis and centrifugal terms is
their part on the joints.

What a barrier is overrun by (drift of a part of a step, or a ground whose gap jumps) is a matter of
place. Were it taken back by a speed, the robot would leave with that speed: the robot is moved out,
its velocity stays.

No part makes energy. The velocity terms of a part are those of its start and its middle. Where
bodies turn far within a part they may make energy, and what is too fast turns farther in the next
one. So a part that ends with more energy than it was given is slowed down at its end: the joints
first, whose speeds alone these terms change, with the momentum of free bases kept; where a rigid
body would still have too much, all of it.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Dense, OutRow, Places, Row, ask, compiled, inner, local
from wbc.mechanics.inertia import momentum_at, velocity_at
from wbc.mechanics.kinematics import JOINT, PLACES, ROWS, moved_along, placed_at
from wbc.mechanics.linear import add_times, copy_to, dot, factor_inertia, rest_of_way
from wbc.mechanics.memory import reserve, row_copy, row_of, table_copy, table_of, whole_of, zeros_of
from wbc.mechanics.newton import UNSOLVED, solve_laws, speeds_at
from wbc.mechanics.rows import system_of
from wbc.sim.step.books import MADE, books_of, survey
from wbc.sim.step.contacts import (
    NEAR,
    barrier_rows,
    gaps_at,
    gaps_of,
    look,
    other_place,
    put,
    rates_at,
    touch_ground,
    weigh,
)
from wbc.sim.step.pairs import FAR
from wbc.sim.step.part_rows import NO_INERTIA, PartRows, rows_of, solve_part
from wbc.sim.step.tables import BOOK, LENGTH, RETURN_SPEED, TOUCH, Opened

# [rad] by which no body turns in a part that is not looked at; the disc at `MADE` turns so far.
_TURN = 0.03

SMOOTH, LANDED = 1, 2
"""A part to the end; one in which a barrier was passed on the way."""

_MESH_ROUNDS = 40
_MESH_TOLERANCE = 1e-9  # of the torque that a gear carries; steps are solved to 1e-10
# Change of what a gear carries per change of what its loss assumes: below it lies a loss of 95 % of
# the power forward, above it one of 95 % backward; beyond them is rounding.
_LEAST_SLOPE, _MOST_SLOPE = -19.0, 0.95

# Share of all pushes that is none: what opens is not held back by an impulse of 1e-20 N s.
_ROUNDING = 1e-12

DRIFT = 1e-8
"""Overlap, or gap of a barrier that is pressed, [m, rad] from which on it is taken back."""

# Most shifts along the rows of the middle that take an overlap back. Gaps are not linear in the
# shift: after steps of 20 ms one shift left up to 0.1 mm. Of 614 corrections in 60 soft scenes of
# 519 steps of random scenes took one shift, 81 two, 11 three and 3 four.
_CORRECTIONS = 10

# Compliance, as a share of its own, of a barrier that pushes (it chooses among equal pushes), and
# of one that pulls. Two places of a box 2 mm apart on a field, one 2e-6 m open and one 3e-6 m deep,
# took a shift of 0.7 mm when both were met exactly, which lifted the box by 0.01 J.
_HAIR, _SOFT = 1e-9, 1e-3
_TRIES = 100


@inner
def carry(plant: Opened, v: Row) -> None:
    """Keep the momentum (6) that every tree on a free base has at v (nv,)."""
    placed = plant.placed
    for i in range(len(placed.bases)):
        root, carried = placed.bases[i, JOINT], placed.carried[i, :6]
        momentum_at(plant.tree, placed.columns, placed.composite, root, v, carried)


@inner
def set_momentum(plant: Opened, v: OutRow) -> None:
    """Change the bases' rows of v (nv,) so that every tree has the momentum that is carried."""
    placed = plant.placed
    for i in range(len(placed.bases)):
        base, carried = placed.bases[i], placed.carried[i, :6]
        velocity_at(plant.tree, placed.columns, placed.composite, base, carried, v)


@inner
def advance(plant: Opened, half: float, q: OutRow) -> None:
    """Move the bases in q and poses so that each centre of mass has moved in a straight line.

    Args:
        plant: with poses, momentum and centres of mass; the latter are moved.
        half: time [s] that the centres of mass move on.
        q: (nq,), changed.
    """
    joints, shapes, poses = plant.tree.joints, plant.tree.shapes, plant.placed.poses
    bases, carried = plant.placed.bases, plant.placed.carried
    for i in range(len(bases)):
        joint, missing, center = bases[i, JOINT], local(3), local(3)
        missing[:] = 0.0
        for body in range(len(joints)):
            if joints[body, 4] == joint:
                placed_at(poses[body], shapes[body, 16:19], center)
                add_times(-shapes[body, 15], center, missing)
        for k in range(3):
            carried[i, 6 + k] += half / carried[i, 9] * carried[i, k]
            missing[k] = carried[i, 6 + k] + missing[k] / carried[i, 9]
        if bases[i, ROWS] == 3:
            missing[1] = 0.0
            q[bases[i, PLACES]] += missing[0]
            q[bases[i, PLACES] + 1] += missing[2]
        else:
            add_times(1.0, missing, q[bases[i, PLACES] :])
        for body in range(len(joints)):
            if joints[body, 4] == joint:
                add_times(1.0, missing, poses[body, 9:])


@inner
def to_end(plant: Opened, half: float) -> None:
    """Move q (nq,) and the poses from the middle of a part to its end, half a step later."""
    end = plant.end
    carry(plant, end.after)
    moved_along(plant.tree.joints, end.before, end.after, half, end.position)
    put(plant, end.position)
    advance(plant, half, end.position)


@inner
def to_middle(plant: Opened, half: float) -> None:
    """Write the middle of a part: q (nq,), v (nv,) half a step later, with the same momentum.

    The attitude goes by the velocity of the middle (one correction), which makes free rotation of
    second order. The memory then stands at the middle, with all of H_l. How fast the closed
    contacts open at the start is written beside it, see `rates_at`.
    """
    joints, bases = plant.tree.joints, plant.placed.bases
    q, v, closed = plant.now.position, plant.now.velocity, plant.now.closed
    middle, speed, rate = plant.end.before, plant.end.speed, plant.end.rate
    touching, rate[:] = False, 0.0
    for i in range(plant.obstacles.limits, len(closed)):
        touching = touching or closed[i]
    if len(bases) or touching:
        put(plant, q)
        look(plant)
    if touching:
        touch_ground(plant, closed)
        rates_at(plant, closed, v, rate)
    copy_to(v, speed)
    if len(bases):
        carry(plant, v)
        for i in range(len(bases)):
            behind, carried = plant.placed.composite[bases[i, JOINT]], plant.placed.carried[i]
            carried[9] = behind[0]
            copy_to(plant.placed.about, carried[6:])
            add_times(1.0 / behind[0], behind[1:4], carried[6:])
        moved_along(joints, q, v, half, middle)
        put(plant, middle)
        look(plant)
        set_momentum(plant, speed)
    moved_along(joints, q, speed, half, middle)
    put(plant, middle)
    advance(plant, half, middle)
    weigh(plant)
    copy_to(v, speed)
    set_momentum(plant, speed)


@inner
def shift_of(
    plant: Opened, metric: Dense, matrix: Dense, pressed: Places, missing: Row, shift: OutRow
) -> bool:
    """Write the least shift (nv,) that takes overlaps back; False where none can be found.

    It is the speed at which rows end that push, and those that pull softly beside pressed ones:
    rows of places that are near to each other are nearly the same, and to meet what each of them
    lacks exactly would take a shift a thousand times as long.

    Args:
        plant: whose heap has room.
        metric: (nv, nv) in which it is least.
        matrix: (b, nv) rows of the closed limits and normals.
        pressed: (b,) one where they carry an impulse: their gaps are taken back from either side.
        missing: (b,) by which their gaps are to open, below zero where they may close.
        shift: to write.
    """
    heap, n, count, size = plant.heap, len(shift), len(missing), len(missing)
    for i in range(count):
        size += pressed[i]
    taken, lower, rows = heap.used[0], table_of(heap, n, n), table_of(heap, size, n)
    targets, start, push = row_of(heap, size), zeros_of(heap, size), row_of(heap, size)
    good, still, none, pull = factor_inertia(metric, lower), zeros_of(heap, n), rows[:0], count
    for i in range(count if good else 0):
        copy_to(matrix[i], rows[i])
        targets[i] = missing[i]
        if pressed[i] > 0:
            for j in range(n):
                rows[pull, j] = -matrix[i, j]
            targets[pull], pull = -missing[i], pull + 1
    if good:
        system = system_of(heap, rows, lower, still, none, none, targets, still[:0])
        for i in range(size):
            system.give[i] = (_HAIR if i < count else _SOFT) * system.own[i]
        good = solve_laws(system, start, 1.0, push)[1] < UNSOLVED
        speeds_at(system, push, shift, targets)
        rest_of_way(lower, shift)
    heap.used[0] = taken
    return good


@inner
def take_back(plant: Opened, rows: PartRows, pressed: Places, furthest: float) -> None:
    """Move the robot out of overlaps, in a few shifts, see `_CORRECTIONS`.

    Their size is measured with the rotors of rigid gears: what is light moves first.

    Args:
        plant: its memory stands at the end, but for `placed.inertia`: that is the middle's.
            Position, gaps and shift of the end are changed.
        rows: of the part.
        pressed: (b,) one where its closed limits and normals carry an impulse.
        furthest: [m, rad] by which an overlap is taken back at most.
    """
    q, gap, gears, heap = plant.end.position, plant.end.gap, plant.gears, plant.heap
    held, n, off, first = rows.held, rows.matrix.shape[1], np.inf, len(rows.laws)
    count, metric = len(held), table_copy(heap, plant.placed.inertia)
    matrix = rows.matrix[first : first + count]
    aim, missing, shift = row_of(heap, count), row_of(heap, count), row_of(heap, n)
    last, gap_last = row_copy(heap, q), row_copy(heap, gap)
    for g in range(len(gears.rows)):
        turning = gears.rows[g]
        for i in range(0 if gears.yields[g] else n):
            if turning[i] != 0.0:
                add_times(gears.inertia[g] * turning[i], turning, metric[i])
    for row in range(count):
        here = gap[held[row]]
        most = furthest if pressed[row] > 0 else np.inf
        aim[row] = here + min(max(-here, -most), furthest)
    for turn in range(_CORRECTIONS + 1):
        before, off = off, 0.0
        for row in range(count):
            missing[row] = aim[row] - gap[held[row]] if held[row] < plant.obstacles.rigid else -FAR
            off = max(off, abs(missing[row]) if pressed[row] > 0 else missing[row])
        if not off < before:  # Ground with edges: a shift that leads astray is undone.
            copy_to(last, q)
            copy_to(gap_last, gap)
            put(plant, q)
            return
        if turn > 0:
            add_times(1.0, shift, plant.end.moved)
        small = off <= DRIFT or off > 0.5 * before or turn == _CORRECTIONS
        if small or not shift_of(plant, metric, matrix, pressed, missing, shift):
            return
        copy_to(q, last)
        copy_to(gap, gap_last)
        moved_along(plant.tree.joints, last, shift, 1.0, q)
        gaps_of(plant, q, gap)


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
    end, held, off = plant.end, rows.held, 0.0
    to_end(plant, 0.5 * rows.step)
    gaps_at(plant, end.position, end.closed[:0], end.gap)
    pressed, furthest = whole_of(plant.heap, len(held)), plant.bounds[RETURN_SPEED] * rows.step
    jumped, rigid = other_place(plant.bounds, rows.step), plant.obstacles.rigid
    end.moved[:], end.deepest[:] = 0.0, 0.0
    for row in range(len(held)):
        gap = end.gap[held[row]] if held[row] < rigid else np.inf
        pressed[row] = int(pushes[row] > 0.0 and gap < jumped)
        off = max(off, abs(gap) if pressed[row] > 0 else -gap)
        if -gap - furthest > max(end.deepest[0], TOUCH):
            end.deepest[0], end.deepest[1] = -gap - furthest, held[row]
    if off > DRIFT:
        take_back(plant, rows, pressed, furthest)
    copy_to(end.after, end.velocity)
    if len(plant.placed.bases):
        look(plant)
        set_momentum(plant, end.velocity)


@inner
def keep(plant: Opened, rows: PartRows) -> None:
    """Write the impulses after which a part ends, and how the motors move then."""
    end = plant.end
    end.impulse[:] = 0.0
    for i in range(len(rows.impulse)):
        end.impulse[rows.places[i]] = rows.impulse[i]
    for i in range(len(rows.motor)):
        end.motor_speed[i] = rows.speed[i] + rows.end[i]
        end.mesh_impulse[i] = rows.impulse[i] + np.sign(end.motor_speed[i]) * rows.laws[i, 5]


@inner
def hold_or_land(plant: Opened, held: Places, pushes: Row) -> int:
    """Write which barriers stay closed, pressed ones or in touch; return LANDED or SMOOTH.

    One that is passed by more than a touch has landed. Compliant ones neither close nor land.

    Args:
        plant: with the gaps of the end.
        held: (l + k,) numbers of the closed limits and normals.
        pushes: (l + k,) their impulses.
    """
    result, rigid = SMOOTH, plant.obstacles.rigid
    gap, closed = plant.end.gap, plant.end.closed
    for i in range(rigid):
        if gap[i] < -TOUCH and not closed[i]:
            result = LANDED
    for row in range(len(held)):
        i = held[row]
        closed[i] = i < rigid and (gap[i] <= TOUCH or (pushes[row] > 0.0 and gap[i] < FAR))
    return result


@compiled(inside=True)
def stored_in_end(plant: Opened, v: Row) -> float:
    """Return what is stored at the end of a part with other speeds v (nv,) [J]."""
    end = plant.end
    return survey(plant, end.position, v, end.deflection, end.motor_speed)[0]


@compiled(inside=True)
def slowed(plant: Opened, fast: Row, share: float, v: OutRow) -> float:
    """Write v (nv,) with a share of the joints' speeds, and the momentum; return what is stored."""
    v[:] = share * fast
    set_momentum(plant, v)
    return stored_in_end(plant, v)


@compiled(inside=True)
def keep_passive(plant: Opened) -> None:
    """Take from v (nv,) at the end of a part what it has made; it stands in books[BOOK.taken] [J].

    Args:
        plant: its memory stands at the end, with the books.
    """
    now, end, books, fast = plant.now, plant.end, plant.end.books, plant.end.velocity
    work = books[BOOK.motor] + books[BOOK.external] + books[BOOK.effects]
    had, _, _ = survey(plant, now.position, now.velocity, now.deflection, now.motor_speed)
    has = stored_in_end(plant, fast)
    most = had + work + MADE * (books[BOOK.kinetic] + abs(work))
    if has <= most:
        return
    given, v = fast.copy(), end.velocity
    none, half = slowed(plant, given, 0.0, v), slowed(plant, given, 0.5, v)
    # Stored energy is quadratic in the share: none + along share + square share^2.
    square, along = 2.0 * (has + none - 2.0 * half), 4.0 * half - has - 3.0 * none
    if none < most:
        root = along + sqrt(max(along * along + 4.0 * square * (most - none), 0.0))
        share = 2.0 * (most - none) / root if root > 0.0 else 1.0
        books[BOOK.taken] = has - slowed(plant, given, min(share, 1.0), v)
        return
    slowed(plant, given, 0.0, v)
    given[:] = 0.0
    rest = stored_in_end(plant, given)
    share = sqrt((most - rest) / (none - rest)) if rest < most else 0.0
    v[:] *= share
    books[BOOK.taken] = has - rest - share * share * (none - rest)


@inner
def part_of_step(plant: Opened, step: float) -> int:
    """Do a part from the state of the plant.

    Python is asked for what acts in the middle where loops do not know it.

    Args:
        plant: what moves, with the forces, the state at the start, and the barriers that may close
            within the part, `plant.end.kept`; the rest of `plant.end` is written.
        step: h [s].

    Returns:
        SMOOTH or LANDED; ten and more where it failed, ten beyond what `solve_part` says.
    """
    end, gears = plant.end, plant.gears
    to_middle(plant, 0.5 * step)
    plant.now.numbers[LENGTH] = step
    if plant.forces.asked != 0:
        ask(plant.forces.asked)
    rows = rows_of(plant, step)
    if not rows.lower[0, 0] > 0.0:
        return 10 + NO_INERTIA
    way = solve_part(plant, rows, end.speed, 1.0)
    keep(plant, rows)
    if way >= UNSOLVED:
        return 10 + way
    elements, both, turns = len(rows.laws), len(rows.targets), books_of(plant, rows)
    pressed = rows.impulse[elements : elements + both]
    rounding = 0.0
    for i in range(both):
        rounding += _ROUNDING * abs(pressed[i])
    for i in range(both):
        pressed[i] = pressed[i] if pressed[i] > rounding else 0.0
    arrive(plant, rows, pressed)
    if not np.isfinite(np.sum(end.velocity)):  # it blew up on the way
        return 10 + NO_INERTIA
    for i in range(len(end.deflection)):
        end.deflection[i] = 0.0
        if gears.yields[i]:  # motors stay where they are while the robot is moved out of overlaps
            turned = 0.5 * step * (rows.relative[i] + rows.end[i]) - dot(end.moved, gears.rows[i])
            end.deflection[i] = plant.now.deflection[i] + turned
    if not 0.5 * step * turns <= _TURN:
        keep_passive(plant)
    return hold_or_land(plant, rows.held, pressed)


@compiled(inside=True)
def part_with_mesh(plant: Opened, step: float) -> int:
    """Do a part in which effects see the torque that the gears then carry, see `part_of_step`.

    Secant steps of each gear alone, from what its effect remembers of the step before: what a gear
    carries is nearly linear in what it is taken to carry, and other gears change it little.
    """
    taken, mesh = plant.forces.mesh, plant.end.mesh_impulse
    taken[:] = np.nan
    result = part_of_step(plant, step)
    if len(taken) == 0 or result >= 10:
        return result
    miss = change = slope = np.zeros(len(taken))
    taken[:] = mesh / step
    for _ in range(_MESH_ROUNDS):
        result, last, carried = part_of_step(plant, step), miss, mesh / step
        miss = carried - taken
        if result >= 10 or np.all(np.abs(miss) <= _MESH_TOLERANCE * (1.0 + np.abs(carried))):
            break
        secant = np.minimum(np.maximum(1.0 + (miss - last) / change, _LEAST_SLOPE), _MOST_SLOPE)
        slope = np.where(change == 0.0, slope, secant)
        change = miss / (1.0 - slope)
        taken[:] += change
    return result


@compiled
def lift(plant: Opened, stiff: Row, q: OutRow) -> bool:
    """Move q (nq,) out of the ground; False where no motion does it, and q stays.

    Args:
        plant: what is moved.
        stiff: (nv,) ones for coordinates that keep still where others can do it.
        q: to change.
    """
    n, start, here = len(stiff), q.copy(), np.empty(len(plant.now.closed))
    shift = np.empty(n)
    for _ in range(_TRIES):
        gaps_of(plant, q, here)
        if not np.any(here < -0.5 * TOUCH):
            return True
        near = np.flatnonzero(here < NEAR)
        count, touching = len(near), np.sum(near >= plant.obstacles.limits)
        weigh(plant)
        matrix, axes = np.empty((count + 2 * touching, n)), np.empty((touching * 3, 3))
        barrier_rows(plant, near, 0, matrix, axes)
        metric, most = plant.placed.inertia.copy(), np.max(plant.placed.inertia)
        for i in range(n):
            metric[i, i] += 1e6 * most * stiff[i]
        free, missing = np.zeros(count, dtype=np.int64), np.minimum(-here[near], NEAR)
        reserve(plant.heap, (2 * count + n) * (2 * n + 150))
        if not shift_of(plant, metric, matrix[:count], free, missing, shift):
            break
        moved_along(plant.tree.joints, q.copy(), shift, 1.0, q)
    q[:] = start
    return False
