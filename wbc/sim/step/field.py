"""Ground given by heights on a grid, for compiled loops: where points and bodies touch it.

A field is a row of numbers like any solid: FIELD, the lengths a and b of both axes, the largest
curvature [1/m], the mean spacing of the finer axis [m], from AXES on x (a,) and y (b,), then for
each of the nodes (a, b) height, slopes along x and along y, and mixed derivative, and for each of
the cells (a - 1, b - 1) height and both slopes in its middle, and its own largest curvature.
Between nodes there is one bicubic (Hermite) patch per cell; the surface is level beyond its border.

A body touches where the height of its underside over the field is least: at corners (which are
contact points), along an edge where the field is convex along it, in a face where the field has a
peak under it, and round ones where their distance is least. There the slope is zero. It changes no
faster than the curvature allows, so that steep stretches and cells of the grid, and those that are
far away, are left out; the others are cut into halves, down to a part of a cell, from which
Newton's iteration leads to the place. Of places that would close together only the first is a
barrier. A barrier keeps its identity while its place stays near one node of the grid.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled, inner, local
from wbc.mechanics.kinematics import turned
from wbc.mechanics.linear import add_times, apart, copy_to, dot, go_along
from wbc.sim.step.pairs import FAR, to_segment
from wbc.sim.step.tables import Opened

BEND, SPACING, AXES = 3, 4, 5
AHEAD = 0.02
"""[m] up to which gaps are known at most before they close: 20 m/s in steps of 1 ms."""
_ROUNDS = 20  # of Newton's iteration, which settles in 1 to 4 where a place is near
_FLAT = 1e-5  # share of a curvature beside which another one is none
_SETTLED = 1e-6  # [m]; the next step would be about this, squared, over the radius of curvature
_LOWEST = 1e-8  # [m] up to which a place settles where a body is lowest
_BULGE = 1e-7  # [m] of a place above the line through those beside it; less is flat
_SAME = 2e-6  # [m] twice what the curvature lifts a place that is one with another, at most
_INSIDE = 1e-6  # [m] by which a place may lie beside a face
_STEEP = 1e-3  # upward part of a normal; faces with less are upright
_PART = 0.125  # of a cell, from which on it is not cut further
_STARTS = 512  # most places from which to look for touches of a body


@inner
def cell_of(field: Row, first: int, count: int, at: float) -> int:
    """Return the cell of an axis (count,), from `first` on, in which a place is, or the nearest."""
    share = (at - field[first]) / (field[first + count - 1] - field[first])
    cell = int(min(max(share, 0.0), 1.0) * (count - 1))  # exact where lines are evenly apart
    cell = min(cell, count - 2)
    while cell > 0 and field[first + cell] > at:
        cell -= 1
    while cell < count - 2 and field[first + cell + 1] <= at:
        cell += 1
    return cell


@inner
def cubics(field: Row, first: int, count: int, at: float, found: OutRow) -> int:
    """Write Hermite's cubics at a place of an axis; return the cell.

    Args:
        field: with the axis (count,) from `first` on.
        first, count: see above.
        at: place on the axis; beyond its ends the end, where all derivatives are zero.
        found: (12,) to write: weights of value and slope at the cell's start, then at its end;
            their first derivatives; their second ones.
    """
    low, last = cell_of(field, first, count, at), field[first + count - 1]
    inside = field[first] <= at <= last
    width = field[first + low + 1] - field[first + low]
    s = (min(max(at, field[first]), last) - field[first + low]) / width
    found[0], found[1] = (1.0 + 2.0 * s) * (1.0 - s) ** 2, s * (1.0 - s) ** 2 * width
    found[2], found[3] = s * s * (3.0 - 2.0 * s), s * s * (s - 1.0) * width
    one, two = (1.0 / width, 1.0 / width**2) if inside else (0.0, 0.0)
    found[4], found[6] = 6.0 * s * (s - 1.0) * one, 6.0 * s * (1.0 - s) * one
    found[5] = (1.0 - s) * (1.0 - 3.0 * s) * width * one
    found[7] = s * (3.0 * s - 2.0) * width * one
    found[8], found[10] = (12.0 * s - 6.0) * two, (6.0 - 12.0 * s) * two
    found[9], found[11] = (6.0 * s - 4.0) * width * two, (6.0 * s - 2.0) * width * two
    return low


@inner
def surface_at(field: Row, x: float, y: float, found: OutRow) -> None:
    """Write z, its slopes along x and y, and its derivatives xx, xy and yy (6,) at a place."""
    a, b, along_x, along_y = int(field[1]), int(field[2]), local(12), local(12)
    i, j = cubics(field, AXES, a, x, along_x), cubics(field, AXES + a, b, y, along_y)
    found[:] = 0.0
    for p in range(4):
        node = AXES + a + b + 4 * ((i + p // 2) * b + j) + p % 2
        value = slope = bend = 0.0
        for q in range(4):
            own = field[node + 4 * (q // 2) + 2 * (q % 2)]
            value, slope = value + along_y[q] * own, slope + along_y[4 + q] * own
            bend += along_y[8 + q] * own
        found[0], found[1] = found[0] + along_x[p] * value, found[1] + along_x[4 + p] * value
        found[2], found[3] = found[2] + along_x[p] * slope, found[3] + along_x[8 + p] * value
        found[4], found[5] = found[4] + along_x[4 + p] * slope, found[5] + along_x[p] * bend


@inner
def way_out(at: Row, normal: OutRow) -> None:
    """Write the normal (3,) out of a field; `at` (6,) see `surface_at`."""
    size = sqrt(1.0 + at[1] * at[1] + at[2] * at[2])
    normal[0], normal[1], normal[2] = -at[1] / size, -at[2] / size, 1.0 / size


@inner
def newton_step(
    a: float, b: float, d: float, slope_x: float, slope_y: float, place: OutRow
) -> float:
    """Move a place (2,) to where slopes end that rise by [[a, b], [b, d]]; return how far."""
    whole = a * d - b * b
    x, y = (d * slope_x - b * slope_y) / whole, (a * slope_y - b * slope_x) / whole
    place[0], place[1] = place[0] - x, place[1] - y
    return max(abs(x), abs(y))


@inner
def go_nearest(
    field: Row, start: Row, end: Row, reach: float, width: float, place: OutRow, at: OutRow
) -> bool:
    """Move a place of a field to the nearest one to a segment among those about it.

    The way from there to the segment is at right angles to the surface: Newton's iteration on the
    square of the distance, of a point for a segment without length. No turn goes farther away.

    Args:
        field: see above.
        start, end: (3,) of the segment.
        reach: [m] up to which the first place may be away.
        width: [m] by which the place moves at most, along each axis.
        place: (3,) x and y to change, and the share of the segment's way to write.
        at: (6,) to write, see `surface_at`.

    Returns:
        whether it settles at a least distance, on the side of the first place.
    """
    spot, near, settled, x, y = local(3), local(3), False, place[0], place[1]
    least = side = last_x = last_y = 0.0
    length = sqrt(apart(start, end))
    for turn in range(_ROUNDS):
        surface_at(field, place[0], place[1], at)
        spot[0], spot[1], spot[2] = place[0], place[1], at[0]
        place[2] = to_segment(start, end, spot, near)
        deep, square = at[0] - near[2], apart(spot, near)
        if turn == 0:
            side = deep
            if square > reach * reach:
                return False
        elif settled:
            return bool(deep * side >= 0.0)
        elif square > least:
            place[0], place[1] = 0.5 * (place[0] + last_x), 0.5 * (place[1] + last_y)
            continue
        least, last_x, last_y, u, v = square, place[0], place[1], 0.0, 0.0
        if 0.0 < place[2] < 1.0:
            u = (end[0] - start[0] + (end[2] - start[2]) * at[1]) / length
            v = (end[1] - start[1] + (end[2] - start[2]) * at[2]) / length
        a = 1.0 + at[1] * at[1] + deep * at[3] - u * u
        b = at[1] * at[2] + deep * at[4] - u * v
        d = 1.0 + at[2] * at[2] + deep * at[5] - v * v
        rising = a > 0.0 and a * d - b * b > _FLAT * a * d
        if not rising:  # downhill all the same, where the square is not convex yet
            more = 2.0 * sqrt(0.25 * (a - d) ** 2 + b * b) - a - d + _FLAT
            a, d = a + max(more, 0.0), d + max(more, 0.0)
        off_x, off_y = place[0] - near[0] + deep * at[1], place[1] - near[1] + deep * at[2]
        settled = newton_step(a, b, d, off_x, off_y, place) <= _SETTLED and rising
        if max(abs(place[0] - x), abs(place[1] - y)) > width:
            return False
    return False


@inner
def field_gap(field: Row, point: Row, reach: float, normal: OutRow) -> float:
    """Return the distance of a point (3,) from a field, and write the way out (3,).

    The nearest place is the one to which Newton's iteration leads from straight below the point.
    Where it does not settle on the point's side, the place is straight below; and where curvature
    cannot bring the field within `reach` [m] of the point.
    """
    at, place = local(6), local(3)
    place[0], place[1] = point[0], point[1]
    surface_at(field, point[0], point[1], at)
    steep, bend = sqrt(at[1] * at[1] + at[2] * at[2]), field[BEND]
    if point[2] - at[0] < reach * (1.0 + steep + 0.5 * bend * reach) and not go_nearest(
        field, point, point, np.inf, np.inf, place, at
    ):
        place[0], place[1] = point[0], point[1]
        surface_at(field, point[0], point[1], at)
    above = point[2] - at[0]
    way_out(at, normal)
    aside = (point[0] - place[0]) * normal[0] + (point[1] - place[1]) * normal[1]
    return float(above * normal[2] + aside)


@inner
def is_same(field: Row, touch: Row, place: Row) -> bool:
    """Return whether a touch (7,) is at a place (3,), or so near that both close together."""
    return bool(apart(touch[4:], place) * max(field[BEND], 2.0) < _SAME)


@inner
def offer(field: Row, touch: OutDense, feature: int, gap: float, normal: Row, place: Row) -> None:
    """Write a touch at a place (3,) among those of a body (s, 7), unless it is there already.

    Its row follows from its feature and the nearest node, so that it stays the same from step to
    step; where it is taken, the next that is free. Where all are taken the nearest touches stay.
    """
    a, b, size, at, free = int(field[1]), int(field[2]), len(touch), -1, False
    xs, ys = field[AXES:], field[AXES + a :]
    i, j = cell_of(xs, 0, a, place[0]), cell_of(ys, 0, b, place[1])
    i += place[0] - xs[i] > xs[i + 1] - place[0]
    j += place[1] - ys[j] > ys[j + 1] - place[1]
    for k in range(size):
        slot = (7 * feature + 9 * i + 5 * j + k) % size
        if touch[slot, 0] >= FAR:
            at, free = at if free else slot, True
        elif is_same(field, touch[slot], place):
            return
        elif not free and touch[slot, 0] > gap and (at < 0 or touch[slot, 0] > touch[at, 0]):
            at = slot
    if at >= 0:
        touch[at, 0] = gap
        copy_to(normal[:3], touch[at, 1:])
        copy_to(place[:3], touch[at, 4:])


@inner
def may_touch(
    at: Row, bend: float, size: float, x: float, y: float, under: Dense, tube: Row
) -> bool:
    """Return whether a body may be lowest, and near, within a distance of a place of a field.

    Args:
        at: (6,) z and slopes at the place, see `surface_at`.
        bend: largest curvature about it [1/m].
        size: the distance [m], level.
        x, y: of the place.
        under: (n, 4) faces of a hull, see `go_under`; none for a round body.
        tube: (7,) both ends and radius of a round body; not read for a hull.
    """
    steep = sqrt(at[1] * at[1] + at[2] * at[2])
    if len(under) == 0:
        spot, near = local(3), local(3)
        spot[0], spot[1], spot[2] = x, y, at[0]
        to_segment(tube[:3], tube[3:6], spot, near)
        steepest, deep = steep + bend * size, at[0] - near[2]
        if apart(spot, near) > (tube[6] + AHEAD + size * sqrt(1.0 + steepest * steepest)) ** 2:
            return False
        off_x, off_y = x - near[0] + deep * at[1], y - near[1] + deep * at[2]
        turns = 1.0 + steepest * steepest + bend * (abs(deep) + size * (1.0 + steepest))
        return bool(off_x * off_x + off_y * off_y <= (turns * size) ** 2)
    highest, slope, level = -np.inf, 0.0, False
    for f in range(len(under)):
        height = under[f, 0] + under[f, 1] * x + under[f, 2] * y - at[0]
        own = (under[f, 1] - at[1]) ** 2 + (under[f, 2] - at[2]) ** 2
        level = level or own <= (bend * size) ** 2
        if height > highest:
            highest, slope = height, own
    return level and highest - size * (sqrt(slope) + 0.5 * bend * size) < AHEAD * (1.0 + steep)


@compiled(inside=True)
def starts_of(
    field: Row, low: Row, high: Row, fine: float, under: Dense, tube: Row, places: OutDense
) -> int:
    """Write places (n, 2) near which a body may be lowest over a field; return how many.

    Args:
        field: see above.
        low, high: (3,) of the body, world.
        fine: [m] half the width of a place that is cut no more.
        under, tube: see `may_touch`.
        places: to write.
    """
    a, b, count, at, left = int(field[1]), int(field[2]), 0, local(6), local(96)
    xs, ys = field[AXES:], field[AXES + a :]
    for i in range(cell_of(xs, 0, a, low[0]), a - 1):
        if xs[i] > high[0]:
            break
        for j in range(cell_of(ys, 0, b, low[1]), b - 1):
            if ys[j] > high[1]:
                break
            cell, depth = AXES + a + b + 4 * (a * b + i * (b - 1) + j), 0
            wide, long = 0.5 * (xs[i + 1] - xs[i]), 0.5 * (ys[j + 1] - ys[j])
            x, y, bend = xs[i] + wide, ys[j] + long, field[cell + 3]
            size = sqrt(wide * wide + long * long)
            copy_to(field[cell : cell + 3], at)
            if may_touch(at, bend, size, x, y, under, tube):
                left[0], left[1], left[2], depth = x, y, 1.0, 1
            while depth > 0:
                depth -= 1
                x, y, share = left[3 * depth], left[3 * depth + 1], 0.5 * left[3 * depth + 2]
                if 2.0 * share * max(wide, long) <= fine or depth > 27:
                    if count < len(places):
                        places[count, 0], places[count, 1] = x, y
                        count += 1
                    continue
                for k in range(4):
                    u = x + share * (wide if k % 2 else -wide)
                    v = y + share * (long if k // 2 else -long)
                    beside = low[0] > u + share * wide or high[0] < u - share * wide
                    if beside or low[1] > v + share * long or high[1] < v - share * long:
                        continue
                    surface_at(field, u, v, at)
                    if may_touch(at, bend, share * size, u, v, under, tube):
                        left[3 * depth], left[3 * depth + 1] = u, v
                        left[3 * depth + 2], depth = share, depth + 1
    return count


@compiled(inside=True)
def meet_round(plant: Opened, which: int, field: Row, touch: OutDense) -> None:
    """Write the touches of a ball, or of what two of them and the line between them are round.

    They stand for those of the contact points at its ends, too.

    Args:
        plant: with the poses, and the touches of contact points.
        which: number of the hull.
        field: see above.
        touch: (s, 7) to write.
    """
    hull, radius = plant.bodies.hulls[which], plant.bodies.shapes[which, 4]
    start, end = plant.obstacles.points[hull[8]], plant.obstacles.points[hull[8] + hull[3] - 1]
    place, at, spot, normal = local(3), local(6), local(3), local(3)
    low, high = local(3), local(3)
    fine, tube, reach = min(field[SPACING], radius), local(7), radius + AHEAD
    tube[6] = radius
    for k in range(3):
        tube[k], tube[3 + k] = start[k], end[k]
        low[k], high[k] = min(start[k], end[k]) - reach, max(start[k], end[k]) + reach
    places, none = np.empty((_STARTS, 2)), np.empty((0, 4))
    count = starts_of(field, low, high, _PART * fine, none, tube, places)
    for i in range(count):
        place[0], place[1] = places[i, 0], places[i, 1]
        if not go_nearest(field, start, end, reach + fine, 0.5 * fine, place, at):
            continue
        way_out(at, normal)
        gap, share = -radius, min(max(place[2], 0.0), 1.0)
        place[2] = at[0]
        go_along(start, end, share, spot)
        gap += dot(spot, normal) - dot(place, normal)
        add_times(-radius, normal, spot)
        if -radius < gap < AHEAD:
            offer(field, touch, 0, gap, normal, spot)


@inner
def least_along(field: Row, start: Row, way: Row, low: float, high: float, at: OutRow) -> float:
    """Return where the height of an edge over the field is least, as a share of its way.

    Args:
        field: see above.
        start, way: (3,) one end of the edge, and the way to the other.
        low, high: shares between which the height stops falling.
        at: (6,) to write, see `surface_at`.
    """
    share, size = 0.5 * (low + high), sqrt(dot(way, way))
    while True:
        surface_at(field, start[0] + share * way[0], start[1] + share * way[1], at)
        if not (high - low) * size > _LOWEST:
            return share
        falls = way[2] < at[1] * way[0] + at[2] * way[1]
        low, high = (share, high) if falls else (low, share)
        share = 0.5 * (low + high)


@inner
def steady_share(slope: float, beyond: float, turns: float) -> float:
    """Return the share of a way on which a height has no least place within reach.

    Args:
        slope: of the height over the field, along the way.
        beyond: height beyond reach.
        turns: how fast the slope changes at most.
    """
    steep = abs(slope)
    if beyond > 0.0:
        steep = max(steep, sqrt(slope * slope + 2.0 * turns * beyond) - steep)
    return steep / turns if turns > 0.0 else 1.0


@inner
def meet_edges(plant: Opened, which: int, field: Row, known: int, touch: OutDense) -> None:
    """Write the touches along the edges of a hull; arguments as of `meet_round`.

    `known` is the first touch of the contact points at its corners with the field.
    The height over the field is least where its slope along the edge rises through zero.
    """
    bodies, points, touches = plant.bodies, plant.obstacles.points, plant.obstacles.touch
    hull, bend, spacing = bodies.hulls[which], field[BEND], field[SPACING]
    way, spot, at, normal = local(3), local(3), local(6), local(3)
    deepest = -0.5 * bodies.shapes[which, 5]
    for e in range(hull[7]):
        first, last = bodies.ends[hull[6] + e, 0], bodies.ends[hull[6] + e, 1]
        start = points[hull[8] + first]
        copy_to(points[hull[8] + last], way)
        add_times(-1.0, start, way)
        square = dot(way, way)
        level = way[0] * way[0] + way[1] * way[1]
        least = min(touches[known + first, 0], touches[known + last, 0])
        if least > AHEAD + 0.125 * bend * level:
            continue
        part, came, share, before = _PART * spacing / sqrt(square), 0.0, 0.0, 0.0
        while True:
            x, y = start[0] + share * way[0], start[1] + share * way[1]
            surface_at(field, x, y, at)
            slope = way[2] - at[1] * way[0] - at[2] * way[1]
            if before < 0.0 <= slope:
                here = least_along(field, start, way, came, share, at)
                copy_to(start, spot)
                add_times(here, way, spot)
                way_out(at, normal)
                gap, rise = (spot[2] - at[0]) * normal[2], -at[3] * way[0] * way[0]
                rise -= 2.0 * at[4] * way[0] * way[1] + at[5] * way[1] * way[1]
                corner = is_same(field, touches[known + first], spot)
                corner = corner or is_same(field, touches[known + last], spot)
                bulges = 0.125 * rise * spacing**2 > _BULGE * square
                if deepest <= gap < AHEAD and bulges and not corner:
                    offer(field, touch, 1 + e, gap, normal, spot)
            if share >= 1.0:
                break
            beyond = start[2] + share * way[2] - at[0] - AHEAD * (1.0 + abs(at[1]) + abs(at[2]))
            step = max(steady_share(slope, beyond, bend * level), part)
            came, before, share = share, slope, min(share + step, 1.0)


@inner
def underneath(under: Dense, x: float, y: float) -> int:
    """Return the highest of planes z = p + q x + r y at a place: the face under a hull there."""
    best, highest = -1, -np.inf
    for f in range(len(under)):
        height = under[f, 0] + under[f, 1] * x + under[f, 2] * y
        if height > highest:
            best, highest = f, height
    return best


@inner
def go_under(under: Dense, field: Row, width: float, place: OutRow, at: OutRow) -> bool:
    """Move a place (2,) to where a hull's height over a field is least, among those about it.

    Args:
        under: (n, 4) planes of the hull that face down, see `meet_faces`.
        field: see above.
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
        now = underneath(under, place[0], place[1])
        a, b, d = -at[3], -at[4], -at[5]
        least = 0.5 * (a + d) - sqrt(0.25 * (a - d) ** 2 + b * b)
        if settled:
            return now == face and least > flat
        face, off_x, off_y = now, under[now, 1] - at[1], under[now, 2] - at[2]
        if least < flat:  # towards the peak all the same, where the field is not convex yet
            a, d = a + flat - 2.0 * least, d + flat - 2.0 * least
        settled = newton_step(a, b, d, off_x, off_y, place) <= _LOWEST
        if max(abs(place[0] - x), abs(place[1] - y)) > width:
            return False
    return False


@compiled(inside=True)
def meet_faces(plant: Opened, which: int, field: Row, pose: Row, touch: OutDense) -> None:
    """Write the touches in the faces of a hull, in a pose (12,); the rest as of `meet_round`."""
    bodies, points, hull = plant.bodies, plant.obstacles.points, plant.bodies.hulls[which]
    faces, down, up = hull[5], 0, hull[5]
    planes, own, spacing = np.empty((faces, 4)), local(3), field[SPACING]
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
    places, under = np.empty((_STARTS, 2)), planes[:down]
    count = starts_of(field, low, high, _PART * spacing, under, local(7), places)
    for i in range(count):
        place[0], place[1] = places[i, 0], places[i, 1]
        if not go_under(under, field, spacing, place, at):
            continue
        f = underneath(under, place[0], place[1])
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
