"""Where bodies touch a height field beside the corners: in several places, along edges, in faces.

A body touches where the height of its underside over the field is least: at corners (which are
contact points), along an edge where the field is convex along it, in a face where the field has a
peak under it, and round ones where their distance is least. Each is found from the grid, then
exactly on the smooth surface. Of places that would close together only the first is a barrier. A
barrier keeps its identity while its place stays
near one node of the grid.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Row,
    compiled,
    local,
)
from wbc.sim.step.field import AHEAD, cell_of, go_nearest, surface_at, way_out
from wbc.sim.step.pairs import FAR, pose_of, turned
from wbc.sim.step.tables import OPENED, Opened

_BULGE = 1e-7  # [m] of a place above the line through those beside it; less is flat
_SAME = 2e-6  # [m] twice what the curvature lifts a place that is one with another, at most
_INSIDE = 1e-6  # [m] by which a place may lie beside a face
_STEEP = 1e-3  # upward part of a normal; faces with less are upright
_ROUNDS = 20  # of Newton's iteration
_SETTLED = 1e-8  # [m]


@compiled(Flag, Row, Row, Row, counted=False)
def is_same(field: FloatArray, touch: FloatArray, place: FloatArray) -> bool:
    """Return whether a touch (7,) is at a place (3,), or so near that both close together."""
    a, b, square = int(field[1]), int(field[2]), 0.0
    for k in range(3):
        square += (touch[4 + k] - place[k]) ** 2
    same: bool = square * max(field[3 + a + b + 4 * a * b], 2.0) < _SAME
    return same


@compiled(Nothing, Row, OutDense, Count, Number, Row, Row, counted=False)
def offer(
    field: FloatArray,
    touch: FloatArray,
    feature: int,
    gap: float,
    normal: FloatArray,
    place: FloatArray,
) -> None:
    """Write a touch at a place (3,) among those of a body (s, 7), unless it is there already.

    Its row follows from its feature and the nearest node, so that it stays the same from step to
    step; where it is taken, the next that is free. Where all are taken the nearest touches stay.
    """
    a, b = int(field[1]), int(field[2])
    i, j = cell_of(field, 3, a, place[0]), cell_of(field, 3 + a, b, place[1])
    i += place[0] - field[3 + i] > field[4 + i] - place[0]
    j += place[1] - field[3 + a + j] > field[4 + a + j] - place[1]
    size, at, free = len(touch), -1, False
    for k in range(size):
        slot = (7 * feature + i * b + j + k) % size
        if touch[slot, 0] >= FAR:
            at, free = at if free else slot, True
        elif is_same(field, touch[slot], place):
            return
        elif not free and touch[slot, 0] > gap and (at < 0 or touch[slot, 0] > touch[at, 0]):
            at = slot
    if at >= 0:
        touch[at, 0] = gap
        for x in range(3):
            touch[at, 1 + x], touch[at, 4 + x] = normal[x], place[x]


@compiled(Number, Row, counted=False)
def spacing_of(field: FloatArray) -> float:
    """Return the mean spacing of the grid along its finer axis [m]."""
    a, b = int(field[1]), int(field[2])
    along, across = field[2 + a] - field[3], field[2 + a + b] - field[3 + a]
    finer: float = min(along / (a - 1), across / (b - 1))
    return finer


@compiled(Nothing, OPENED, Count, Row, Count, OutDense, counted=False)
def meet_round(plant: Opened, which: int, field: FloatArray, known: int, touch: FloatArray) -> None:
    """Write the touches of a ball, or of what two of them and the line between them are round.

    Places all around, as near to each other as nodes or half a radius, lead there.

    Args:
        plant: with the poses, and the touches of contact points.
        which: number of the hull.
        field: see `wbc.sim.step.field`.
        known: first touch of the contact points at its ends with the field.
        touch: (s, 7) to write.
    """
    hull, radius = plant.bodies.hulls[which], plant.bodies.shapes[which, 4]
    start, end = plant.obstacles.points[hull[8]], plant.obstacles.points[hull[8] + hull[3] - 1]
    place, at, spot, normal = local(3), local(6), local(3), local(3)
    reach, fine, ends = radius + AHEAD, min(spacing_of(field), 0.5 * radius), plant.obstacles.touch
    x, y = min(start[0], end[0]) - reach, min(start[1], end[1]) - reach
    for i in range(int((abs(end[0] - start[0]) + 2.0 * reach) / fine) + 2):
        for j in range(int((abs(end[1] - start[1]) + 2.0 * reach) / fine) + 2):
            place[0], place[1] = x + i * fine, y + j * fine
            if not go_nearest(field, start, end, reach + fine, fine, place, at):
                continue
            way_out(at, normal)
            gap, share = -radius, min(max(place[2], 0.0), 1.0)
            place[2] = at[0]
            for k in range(3):
                spot[k] = start[k] + share * (end[k] - start[k])
                gap += (spot[k] - place[k]) * normal[k]
                spot[k] -= radius * normal[k]
            if -radius < gap < AHEAD and not (
                is_same(field, ends[known], spot) or is_same(field, ends[known + hull[3] - 1], spot)
            ):
                offer(field, touch, 0, gap, normal, spot)


@compiled(Number, Row, Row, counted=False)
def rise_along(at: FloatArray, way: FloatArray) -> float:
    """Return how fast the slope of a height over the field rises along a way (3,)."""
    x, y = way[0], way[1]
    rise: float = -at[3] * x * x - 2.0 * at[4] * x * y - at[5] * y * y
    return rise


@compiled(Number, Row, Row, Row, Number, Number, OutRow, counted=False)
def least_along(
    field: FloatArray, start: FloatArray, way: FloatArray, low: float, high: float, at: FloatArray
) -> float:
    """Return where the height of an edge over the field is least, as a share of its way.

    Args:
        field: see `wbc.sim.step.field`.
        start, way: (3,) one end of the edge, and the way to the other.
        low, high: shares between which the height stops falling.
        at: (6,) to write, see `surface_at`.
    """
    share, size, step = 0.5 * (low + high), sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2), np.inf
    for _ in range(_ROUNDS):
        surface_at(field, start[0] + share * way[0], start[1] + share * way[1], at)
        if abs(step) * size < _SETTLED:
            break
        slope = way[2] - at[1] * way[0] - at[2] * way[1]
        low, high = (share, high) if slope < 0.0 else (low, share)
        rise = rise_along(at, way)
        further = share - slope / rise if rise > 0.0 else 0.5 * (low + high)
        if not low <= further <= high:
            further = 0.5 * (low + high)
        step, share = further - share, further
    return share


@compiled(Nothing, OPENED, Count, Row, Count, OutDense, counted=False)
def meet_edges(plant: Opened, which: int, field: FloatArray, known: int, touch: FloatArray) -> None:
    """Write the touches along the edges of a hull; arguments as of `meet_round`.

    The height over the field is least where its slope along the edge rises through zero. Steps of
    half a spacing find this; where the curvature cannot bring the field within reach, longer ones.
    """
    bodies, points, touches = plant.bodies, plant.obstacles.points, plant.obstacles.touch
    hull, a, b = bodies.hulls[which], int(field[1]), int(field[2])
    way, spot, at, normal, spacing = local(3), local(3), local(6), local(3), spacing_of(field)
    bend, deepest = field[3 + a + b + 4 * a * b], -0.5 * bodies.shapes[which, 5]
    for e in range(hull[7]):
        first, last = bodies.ends[hull[6] + e, 0], bodies.ends[hull[6] + e, 1]
        square, start = 0.0, points[hull[8] + first]
        for k in range(3):
            way[k] = points[hull[8] + last, k] - start[k]
            square += way[k] * way[k]
        least = min(touches[known + first, 0], touches[known + last, 0])
        if least > AHEAD + 0.125 * bend * square:
            continue
        part, share, before = 1.0 / (int(2.0 * sqrt(square) / spacing) + 1), 0.0, 0.0
        while True:
            surface_at(field, start[0] + share * way[0], start[1] + share * way[1], at)
            slope = way[2] - at[1] * way[0] - at[2] * way[1]
            beyond, step = start[2] + share * way[2] - at[0] - AHEAD, part
            if before < 0.0 <= slope:
                here = least_along(field, start, way, share - part, share, at)
                for k in range(3):
                    spot[k] = start[k] + here * way[k]
                way_out(at, normal)
                gap, rise = (spot[2] - at[0]) * normal[2], rise_along(at, way)
                corner = is_same(field, touches[known + first], spot)
                corner = corner or is_same(field, touches[known + last], spot)
                bulges = 0.125 * rise * spacing**2 > _BULGE * square
                if deepest <= gap < AHEAD and bulges and not corner:
                    offer(field, touch, 1 + e, gap, normal, spot)
            before = slope
            if beyond > 0.0 and bend > 0.0:
                turns = bend * square
                step = (sqrt(slope * slope + 2.0 * turns * beyond) - abs(slope)) / turns
                before = slope if step < part else 0.0
            if share >= 1.0:
                break
            share = min(share + max(step, part), 1.0)


@compiled(Count, Dense, Count, Number, Number, counted=False)
def underneath(planes: FloatArray, count: int, x: float, y: float) -> int:
    """Return the highest of planes z = p + q x + r y at a place: the face under a hull there."""
    best, highest = -1, -np.inf
    for f in range(count):
        height = planes[f, 0] + planes[f, 1] * x + planes[f, 2] * y
        if height > highest:
            best, highest = f, height
    return best


@compiled(Flag, Dense, Count, Row, Number, OutRow, OutRow, counted=False)
def go_under(
    planes: FloatArray,
    count: int,
    field: FloatArray,
    width: float,
    place: FloatArray,
    at: FloatArray,
) -> bool:
    """Move a place (2,) to where a hull's height over a field is least, among those about it.

    Args:
        planes: (n, 4) of the hull, see `meet_faces`.
        count: of them face down.
        field: see `wbc.sim.step.field`.
        width: [m] by which the place moves at most, along each axis.
        place: to change.
        at: (6,) to write, see `surface_at`.

    Returns:
        whether it settles in a face.
    """
    flat = 8.0 * _BULGE / width**2
    settled, face, x, y = False, -1, place[0], place[1]
    for _ in range(_ROUNDS):
        surface_at(field, place[0], place[1], at)
        now = underneath(planes, count, place[0], place[1])
        a, b, d = -at[3], -at[4], -at[5]
        least = 0.5 * (a + d) - sqrt(0.25 * (a - d) ** 2 + b * b)
        if settled:
            return now == face and least > flat
        face, off_x, off_y = now, planes[now, 1] - at[1], planes[now, 2] - at[2]
        if least < flat:  # towards the peak all the same, where the field is not convex yet
            a, d = a + flat - 2.0 * least, d + flat - 2.0 * least
        whole = a * d - b * b
        step_x, step_y = (d * off_x - b * off_y) / whole, (a * off_y - b * off_x) / whole
        place[0], place[1] = place[0] - step_x, place[1] - step_y
        settled = max(abs(step_x), abs(step_y)) <= _SETTLED
        if max(abs(place[0] - x), abs(place[1] - y)) > width:
            return False
    return False


@compiled(Nothing, OPENED, Count, Row, Row, OutDense)
def meet_faces(
    plant: Opened, which: int, field: FloatArray, pose: FloatArray, touch: FloatArray
) -> None:
    """Write the touches in the faces of a hull, in a pose (12,); the rest as of `meet_round`.

    Nodes under the hull that stick out lead to peaks.
    """
    bodies, points, hull = plant.bodies, plant.obstacles.points, plant.bodies.hulls[which]
    a, b, faces, down, up = int(field[1]), int(field[2]), hull[5], 0, hull[5]
    planes, own, spacing = np.empty((faces, 4)), local(3), spacing_of(field)
    place, at, normal, low, high = local(3), local(6), local(3), local(3), local(3)
    low[:], high[:], deepest = np.inf, -np.inf, -0.5 * bodies.shapes[which, 5]
    for i in range(hull[8], hull[8] + hull[3]):
        for k in range(3):
            low[k], high[k] = min(low[k], points[i, k]), max(high[k], points[i, k])
    for f in range(faces):  # those that face down as heights, from the front on
        plane = bodies.planes[hull[4] + f]
        turned(pose, plane, own)
        out = plane[3] + own[0] * pose[9] + own[1] * pose[10] + own[2] * pose[11]
        if own[2] < -_STEEP:
            planes[down, 0] = out / own[2]
            planes[down, 1], planes[down, 2] = -own[0] / own[2], -own[1] / own[2]
            down += 1
        else:
            up -= 1
            planes[up, 0], planes[up, 1], planes[up, 2] = own[0], own[1], own[2]
            planes[up, 3] = out
    if down == 0:
        return
    bend = field[3 + a + b + 4 * a * b]
    for i in range(cell_of(field, 3, a, low[0]), a):
        if i > 0 and field[2 + i] > high[0]:
            break
        for j in range(cell_of(field, 3 + a, b, low[1]), b):
            if j > 0 and field[2 + a + j] > high[1]:
                break
            for k in range(3):
                at[k] = field[3 + a + b + 4 * (i * b + j) + k]
            reach = AHEAD + 0.25 * bend * spacing**2 + at[0]  # half a diagonal of a cell away
            if low[2] > reach + 0.71 * spacing * sqrt(at[1] ** 2 + at[2] ** 2):
                continue
            place[0], place[1] = field[3 + i], field[3 + a + j]
            f = underneath(planes, down, place[0], place[1])
            height = planes[f, 0] + planes[f, 1] * place[0] + planes[f, 2] * place[1]
            slope = sqrt((planes[f, 1] - at[1]) ** 2 + (planes[f, 2] - at[2]) ** 2)
            if height > reach + 0.71 * spacing * slope:
                continue
            if not go_under(planes, down, field, spacing, place, at):
                continue
            f = underneath(planes, down, place[0], place[1])
            place[2] = planes[f, 0] + planes[f, 1] * place[0] + planes[f, 2] * place[1]
            within = True
            for f in range(up, faces):
                plane = planes[f]
                beside = plane[0] * place[0] + plane[1] * place[1] + plane[2] * place[2]
                within = within and beside <= plane[3] + _INSIDE
            way_out(at, normal)
            gap = (place[2] - at[0]) * normal[2]
            if within and deepest <= gap < AHEAD:
                offer(field, touch, 0, gap, normal, place)


@compiled(Nothing, OPENED, Count, counted=False)
def meet_fields(plant: Opened, first: int) -> None:
    """Write the touches of all pairs with fields, as `meet_all` does those of all other pairs."""
    bodies, obstacles, pose = plant.bodies, plant.obstacles, local(12)
    for pair in range(len(bodies.pairs)):
        own, solid = bodies.pairs[pair], bodies.pairs[pair, 5]
        if solid < 0:
            continue
        hull, field = bodies.hulls[own[0]], obstacles.solids[solid]
        touch = obstacles.touch[first + own[2] : first + own[4]]
        for i in range(len(touch)):
            if touch[i, 0] < FAR:
                touch[i] = 0.0
                touch[i, 0], touch[i, 3] = FAR, 1.0
        known, least = solid * len(obstacles.contacts) + hull[8], np.inf
        for i in range(hull[3]):
            least = min(least, obstacles.touch[known + i, 0])
        a, b, around = int(field[1]), int(field[2]), bodies.shapes[own[0], 3]
        if least > AHEAD + 0.5 * field[3 + a + b + 4 * a * b] * around * around:
            continue
        if bodies.shapes[own[0], 4] > 0.0:
            meet_round(plant, own[0], field, known, touch)
        else:
            pose_of(plant.placed.poses, hull[0], pose)
            meet_faces(plant, own[0], field, pose, touch)
            meet_edges(plant, own[0], field, known, touch)
