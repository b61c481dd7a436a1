"""Where limits and contact points are, and the rows of those that are closed, on any ground."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Dense, Flags, OutDense, OutRow, Places, Row, ask, compiled, inner, local
from wbc.mechanics.inertia import bodies_at, composites_of, inertia_at
from wbc.mechanics.kinematics import FRAME, columns_at, place, placed_at
from wbc.mechanics.linear import add_cross, add_times, apart, copy_to, dot
from wbc.sim.ground import BOX, FIELD, PLANE
from wbc.sim.step.field import AHEAD, BEND, field_gap, meet_edges, meet_faces, meet_round
from wbc.sim.step.pairs import FAR, meet
from wbc.sim.step.tables import RETURN_SPEED, Opened

NEAR = 0.05
"""[m, rad] within which corners are looked at one by one, and barriers bound how one is lifted."""

# Of what an overlap is taken back by. In 2,400 steps of thrown bodies (1 ms, 1 m/s) contacts that
# press opened by up to 5e-7 m, and where the nearest place changed by 3e-3 m.
_JUMPED = 0.1


@inner
def box_gap(box: Row, point: Row, normal: OutRow) -> float:
    """Return the distance of a point (3,) from a box (19,), and write the way out (3,).

    Outside, the way leads from the nearest face, edge or corner; inside, to the nearest face.
    """
    nearest, face, sign, way = -np.inf, 0, 1.0, local(3)
    for k in range(3):
        own = 0.0
        for x in range(3):
            own += (point[x] - box[1 + x]) * box[4 + 3 * x + k]
        lower, upper = box[13 + k] - own, own - box[16 + k]
        way[k] = max(upper, 0.0) - max(lower, 0.0)
        if max(lower, upper) > nearest:
            nearest, face, sign = max(lower, upper), k, 1.0 if upper >= lower else -1.0
    size = sqrt(dot(way, way))
    if size > 0.0:
        nearest = size
    else:
        way[face], size = sign, 1.0
    for x in range(3):
        normal[x] = dot(box[4 + 3 * x : 7 + 3 * x], way) / size
    return nearest


@inner
def solid_gap(solid: Row, point: Row, reach: float, normal: OutRow) -> float:
    """Return the distance of a point (3,) from a solid, and write the normal (3,) out of it.

    From a field it is known up to `reach` [m], see `field_gap`.
    """
    if solid[0] == PLANE:
        copy_to(solid[1:4], normal)
        return float(dot(normal, point) - solid[4])
    if solid[0] == BOX:
        return box_gap(solid, point, normal)
    if solid[0] == FIELD:
        return field_gap(solid, point, reach, normal)
    length = sqrt(apart(point, solid[1:4]))
    for k in range(3):  # in the centre up
        normal[k] = (point[k] - solid[1 + k]) / length if length > 0.0 else float(k // 2)
    return float(length - solid[4])


@compiled(counted=False)
def solid_gaps(solid: Row, points: Dense, gaps: OutRow, normals: OutDense) -> None:
    """Write the distances (k,) of points (k, 3) from a solid, and the normals (k, 3)."""
    for i in range(len(points)):
        gaps[i] = solid_gap(solid, points[i], np.inf, normals[i])


@inner
def touch_point(plant: Opened, which: int) -> None:
    """Write gap, normal and place of a contact barrier of a point, for the poses in memory."""
    obstacles, poses = plant.obstacles, plant.placed.poses
    contact, one = which % len(obstacles.contacts), obstacles.touch[which]
    point, radius = obstacles.points[contact], obstacles.contacts[contact, 3]
    if obstacles.asked == 0:
        placed_at(poses[obstacles.contact_at[contact]], obstacles.contacts[contact], point)
        solid = obstacles.solids[which // len(obstacles.contacts)]
        one[0] = solid_gap(solid, point, radius + AHEAD, one[1:4])
    one[0] -= radius
    for k in range(3):
        one[4 + k] = point[k] - radius * one[1 + k]


@inner
def touch_points(plant: Opened, number: int) -> None:
    """Write the contact barriers of all points with a solid.

    Of the corners of a hull that is farther than NEAR from it, its gap is written as theirs.
    """
    obstacles, bodies, solid = plant.obstacles, plant.bodies, plant.obstacles.solids[number]
    count, center, normal, next_point = len(obstacles.contacts), local(3), local(3), 0
    for h in range(len(bodies.hulls)):
        hull, shape, first = bodies.hulls[h], bodies.shapes[h], bodies.hulls[h, 8]
        if first >= count or solid[0] == FIELD:
            break
        for i in range(next_point, first):
            touch_point(plant, number * count + i)
        next_point = first + hull[3]
        placed_at(plant.placed.poses[hull[0]], shape, center)
        away = solid_gap(solid, center, np.inf, normal) - shape[3]
        for b in range(number * count + first, number * count + next_point):
            if away > NEAR:
                obstacles.touch[b, 0] = away
            else:
                touch_point(plant, b)
    for i in range(next_point, count):
        touch_point(plant, number * count + i)


@inner
def meet_field(plant: Opened, pair: int, some: bool, touch: OutDense) -> None:
    """Write the touches (s, 7) of a pair with a field.

    `some` says that touches of contact points have been written for closed barriers alone.
    """
    bodies, obstacles = plant.bodies, plant.obstacles
    which, solid = bodies.pairs[pair, 0], bodies.pairs[pair, 5]
    hull, field = bodies.hulls[which], obstacles.solids[solid]
    known, least = solid * len(obstacles.contacts) + hull[8], np.inf
    radius = bodies.shapes[which, 4]
    for i in range(hull[3]):
        if some:
            touch_point(plant, known + i)
        least = min(least, obstacles.touch[known + i, 0])
        if radius > 0.0:
            obstacles.touch[known + i, 0] = FAR
    around = bodies.shapes[which, 3]
    if least > AHEAD + 0.5 * field[BEND] * around * around:
        return
    if radius > 0.0:
        meet_round(plant, which, field, touch)
    else:
        meet_faces(plant, which, field, plant.placed.poses[hull[0]], touch)
        meet_edges(plant, which, field, known, touch)


@inner
def touch_ground(plant: Opened, closed: Flags) -> None:
    """Write gap, normal and place of contact barriers, for the poses in memory.

    Of those whose flag (2 j + c,) is set, or, without flags, of all.
    """
    obstacles, poses, pairs = plant.obstacles, plant.placed.poses, plant.bodies.pairs
    points, touch, limits = obstacles.points, obstacles.touch, obstacles.limits
    some = len(closed) > 0
    count, ground = len(points), len(touch) - len(plant.bodies.slots)
    for i in range(count if obstacles.asked != 0 or len(pairs) > 0 else 0):
        placed_at(poses[obstacles.contact_at[i]], obstacles.contacts[i], points[i])
    if obstacles.asked != 0:
        ask(obstacles.asked)
    for b in range(ground if some or obstacles.asked != 0 else 0):
        if not some or closed[limits + b]:
            touch_point(plant, b)
    for number in range(0 if some or obstacles.asked != 0 else len(obstacles.solids)):
        touch_points(plant, number)
    for pair in range(len(pairs)):
        first, end = ground + pairs[pair, 2], ground + pairs[pair, 4]
        asked, own = not some, touch[first:end]
        for i in range(limits + first, limits + end if some else 0):
            asked = asked or closed[i]
        if not asked:
            continue
        own[:] = 0.0
        own[:, 0], own[:, 3] = FAR, 1.0
        if pairs[pair, 5] < 0:
            meet(plant.bodies, poses, pair, own)
        else:
            meet_field(plant, pair, some, own)


@inner
def gaps_at(plant: Opened, q: Row, closed: Flags, gap: OutRow) -> None:
    """Write all gaps (2 j + c,): lower limits, upper limits, contact points solid by solid, pairs.

    Args:
        plant: whose poses stand at q.
        q: (nq,).
        closed: (2 j + c,) barriers whose gaps are enough, empty for all.
        gap: to write.
    """
    limit_at, limit_range = plant.obstacles.limit_at, plant.obstacles.limit_range
    j = len(limit_at)
    for i in range(j):
        gap[i] = q[limit_at[i, 0]] - limit_range[i, 0]
        gap[j + i] = limit_range[i, 1] - q[limit_at[i, 0]]
    touch_ground(plant, closed)
    for b in range(len(plant.obstacles.touch)):
        gap[2 * j + b] = plant.obstacles.touch[b, 0]


@inner
def put(plant: Opened, q: Row) -> None:
    """Write the poses at q (nq,)."""
    place(plant.tree.joints, plant.tree.shapes, q, plant.placed.poses)


@inner
def look(plant: Opened) -> None:
    """Write columns and bodies in given poses."""
    tree, placed, about = plant.tree, plant.placed, plant.placed.about
    poses, bases = placed.poses, placed.bases
    copy_to(poses[bases[0, FRAME] if len(bases) else 0, 9:], about)
    columns_at(tree.joints, tree.shapes, poses, about, placed.columns)
    bodies_at(tree.joints, tree.shapes, poses, about, placed.bodies)
    composites_of(tree.joints, placed.bodies, placed.composite)


@inner
def weigh(plant: Opened) -> None:
    """Write columns, bodies and H_l in given poses."""
    look(plant)
    placed = plant.placed
    inertia_at(plant.tree.rows, placed.composite, placed.columns, placed.inertia)


@compiled(counted=False)
def gaps_of(plant: Opened, q: Row, gap: OutRow) -> None:
    """Write the poses and all gaps (2 j + c,) at q (nq,)."""
    put(plant, q)
    gaps_at(plant, q, plant.now.closed[:0], gap)


@inner
def contact_row(plant: Opened, which: int, axis: Row, row: OutRow) -> None:
    """Write how fast a contact barrier opens along an axis (3,) per v (nv,).

    Args:
        plant: whose columns and touches stand where the robot is.
        which: number of the contact barrier.
        axis: unit vector, world.
        row: (nv,) to write.
    """
    columns, about, wrench, arm = plant.placed.columns, plant.placed.about, local(6), local(3)
    touch = plant.obstacles.touch[which]
    copy_to(axis, wrench)
    copy_to(touch[4:], arm)
    add_times(-1.0, about, arm)
    wrench[3:], row[:] = 0.0, 0.0
    add_cross(1.0, arm, axis, wrench[3:])
    for side in range(2):
        i, sign = plant.obstacles.sides[which, side], 1.0 if side == 0 else -1.0
        while i >= 0:
            row[i] += sign * dot(wrench, columns[i])
            i = plant.tree.rows[i, 1]


@inner
def rates_at(plant: Opened, closed: Flags, v: Row, rate: OutRow) -> None:
    """Write how fast the robot opens its closed contacts (2 j + c,) at v (nv,), and nothing else.

    Args:
        plant: whose columns and touches stand where the robot is; `moved` of its end is memory.
        closed: (2 j + c,).
        v: (nv,).
        rate: to write.
    """
    limits, row = plant.obstacles.limits, plant.end.moved
    for b in range(limits, len(closed)):
        if closed[b]:
            contact_row(plant, b - limits, plant.obstacles.touch[b - limits, 1:4], row)
            rate[b] = dot(v, row)


@inner
def contact_axes(normal: Row, axes: OutDense) -> None:
    """Write the normal and two tangents as unit vectors (3, 3).

    On level ground the tangents are along +x, and +y.
    """
    axes[:] = 0.0
    copy_to(normal, axes[0])
    # The world axis less its normal part: x, or y where x is nearly along the normal.
    world = 0 if abs(normal[0]) < 0.9 else 1
    axes[1, world] = 1.0
    add_times(-normal[world], normal, axes[1])
    size = sqrt(dot(axes[1], axes[1]))
    for k in range(3):
        axes[1, k] /= size
    add_cross(1.0, normal, axes[1], axes[2])


@inner
def barrier_rows(plant: Opened, held: Places, first: int, matrix: OutDense, axes: OutDense) -> None:
    """Write the rows of some barriers: limits, contact normals, contact tangents.

    A ball touches a radius below its centre: its point of contact turns with the link, and rolls.

    Args:
        plant: whose poses, columns and touches stand where the robot is.
        held: (l + k,) their numbers, in order.
        first: row of `matrix` at which they start.
        matrix: (r, nv) to write.
        axes: (3 k, 3) to write.
    """
    limit_at = plant.obstacles.limit_at
    j, count = len(limit_at), len(axes) // 3
    limits = len(held) - count
    for row in range(limits):
        matrix[first + row] = 0.0
        matrix[first + row, limit_at[held[row] % j, 1]] = 1.0 if held[row] < j else -1.0
    for c in range(count):
        which, own = held[limits + c] - 2 * j, axes[3 * c : 3 * (c + 1)]
        contact_axes(plant.obstacles.touch[which, 1:4], own)
        for a in range(3):
            at = c if a == 0 else count + c * 2 + a - 1
            contact_row(plant, which, own[a], matrix[first + limits + at])


@inner
def other_place(bounds: Row, step: float) -> float:
    """Return the gap [m] from which on a closed barrier is at another place, in a part of h [s]."""
    return min(_JUMPED * float(bounds[RETURN_SPEED]) * step, 0.5 * FAR)


@inner
def lowest_speeds(plant: Opened, held: Places, step: float, rows: Dense, targets: OutRow) -> None:
    """Write the lowest speeds (l + k,) at which the closed barriers may open over a part.

    A barrier that was kept ahead of its closing, or is at another place now (the nearest place in a
    hollow changed), may close over the half step that is left. A limit
    that is closed may not: the drift of its gap is a matter of place, not of speed. A contact may
    close over the second half by what it opened over the first. A point that rests at the start of
    a part moves in the middle, by the turning of its row; were it held at rest there, its force
    would do work at the mean of both speeds. Held at minus that speed it does none, and comes to
    rest where the part ends. It is never pushed out: with targets at or below zero contacts make no
    energy, whatever else happens in the part.

    Args:
        plant: with gaps and speeds of the middle.
        held: (l + k,) numbers of the closed barriers.
        step: h [s].
        rows: (l + k, nv) of the closed barriers.
        targets: to write.
    """
    limits, end = plant.obstacles.limits, plant.end
    gap, rate, speed, jumped = end.gap, end.rate, end.speed, other_place(plant.bounds, step)
    for row in range(len(held)):
        i, targets[row] = held[row], 0.0
        if end.kept[i] or (i >= limits and gap[i] > jumped):
            targets[row] = -2.0 / step * max(gap[i], 0.0)
        elif i >= limits:
            targets[row] = -max(dot(speed, rows[row]) - rate[i], 0.0)
