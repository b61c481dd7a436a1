"""Where two convex hulls touch: corner on face, edge on edge, balls; for compiled loops.

Each corner, and each end of the stretch in which an edge of the second hull lies under the first,
is a barrier of its own. So a contact keeps its identity from step to step, and lying faces touch at
their outermost points. A barrier takes part while the normal lies in the cone of normals of its
corner or edge, or nearly so (`TILT`): an edge that is nearly level already waits for the ground.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled, inner, local, view
from wbc.mechanics.kinematics import placed_at, turned
from wbc.mechanics.linear import add_cross, add_times, apart, copy_to, dot, go_along
from wbc.sim.step.tables import Bodies

FAR = 10.0
"""Gap [m] of a barrier whose features do not face each other; nothing acts on it."""

TILT = 0.5
"""Sine of the angle by which a normal may leave its cone. Any up to that of a box's corners (90
degrees apart, so 0.7) tells faces from each other; larger ones look ahead further."""
_LEVEL = 1e-6  # sine up to which a normal lies in a cone
_PARALLEL = 1e-3  # sine of the angle below which edges do not cross: their ends touch instead
_INSIDE = 1e-6  # [m] by which a place may lie beside a face or beyond the end of an edge
_SAME = 1e-5  # [m] within which two barriers are one


@inner
def between(outer: Row, inner: Row, pose: OutRow) -> None:
    """Write the pose (12,) of `inner` as `outer` sees it."""
    for i in range(3):
        x, y, z = outer[i], outer[3 + i], outer[6 + i]
        for j in range(3):
            pose[3 * i + j] = x * inner[j] + y * inner[3 + j] + z * inner[6 + j]
        pose[9 + i] = x * (inner[9] - outer[9]) + y * (inner[10] - outer[10])
        pose[9 + i] += z * (inner[11] - outer[11])


@inner
def to_segment(start: Row, end: Row, point: Row, nearest: OutRow) -> float:
    """Write the nearest place (3,) of a segment to a point; return its share of the way."""
    along, square = 0.0, apart(start, end)
    for k in range(3):
        along += (point[k] - start[k]) * (end[k] - start[k])
    share = along / square if square > 0.0 else 0.0
    go_along(start, end, min(max(share, 0.0), 1.0), nearest)
    return share


@inner
def beyond(plane: Row, point: Row) -> float:
    """Return the distance of a point (3,) from a plane (4,), see `Hull`."""
    return float(dot(point, plane) - plane[3])


@inner
def corner_gap(
    bodies: Bodies,
    which: int,
    points: Dense,
    i: int,
    radius: float,
    round_too: bool,
    deepest: float,
    reach: float,
    found: OutRow,
) -> float:
    """Return the gap between a hull and a corner, or the ball at it, of another; FAR for none.

    Args:
        bodies: with the hull.
        which: its number.
        points: (n, 3) corners of the other, in the axes of this hull.
        i: the corner's number.
        radius: of the ball.
        round_too: whether the ends of a hull of balls count.
        deepest: least gap that counts.
        reach: greatest gap that counts.
        found: normal out of the hull (3), and place on it (3), to write.
    """
    hull, point, near = bodies.hulls[which], points[i], local(3)
    planes, own = bodies.planes[hull[4] : hull[4] + hull[5]], bodies.shapes[which, 4]
    if len(planes) == 0:
        corners = bodies.corners[hull[2] : hull[2] + hull[3]]
        share = to_segment(corners[0], corners[len(corners) - 1], point, near)
        if own == 0.0 or not (round_too or (len(corners) == 2 and 0.0 < share < 1.0)):
            return FAR
    else:
        # The nearest face that the corner points to, or, where there is none, nearly points to.
        best, face, points_to = -np.inf, -1, False
        for f in range(len(planes)):
            plane, tilt = planes[f], 0.0
            gap = beyond(plane, point)
            if gap > reach or (points_to and gap <= best):
                continue
            for j in range(len(points)):
                rise, square = beyond(plane, points[j]) - gap, apart(points[j], point)
                tilt = max(tilt, -rise / sqrt(square) if square > 0.0 else 0.0)
            straight = tilt <= _LEVEL
            if tilt <= TILT and (gap > best or (straight and not points_to)):
                best, face, points_to = gap, f, straight
        if face >= 0 and best >= deepest:
            over = True
            for k in range(3):
                found[k] = planes[face, k]
                found[3 + k] = point[k] - best * found[k]
            for f in range(len(planes)):
                over = over and beyond(planes[f], found[3:]) <= _INSIDE
            if over:
                return best - radius
        if radius == 0.0:
            return FAR
        edges, least, spot = bodies.edges[hull[6] : hull[6] + hull[7]], np.inf, local(3)
        for e in range(len(edges)):
            to_segment(edges[e, :3], edges[e, 3:6], point, spot)
            if apart(point, spot) < least:
                least = apart(point, spot)
                copy_to(spot, near)
    away = sqrt(apart(point, near))
    if away <= 0.0:
        return FAR
    for k in range(3):
        found[k] = (point[k] - near[k]) / away
        found[3 + k] = near[k] + own * found[k]
    return float(away - own - radius)


@inner
def edge_gap(one: Row, other: Row, radius: float, tilt: float, found: OutRow) -> float:
    """Return the gap between two edges (12,) that cross, FAR where they do not.

    Args:
        one, other: see `Hull`; of one hull and of the other.
        radius: of the balls that roll along them, both together.
        tilt: sine by which the normal may leave the cones of both edges; zero for the distance of
            the lines whose cones meet, wherever they cross.
        found: normal from the other to the one (3), and place on the other (3), to write.
    """
    along, across, way, normal = local(3), local(3), local(3), local(3)
    for k in range(3):
        along[k], across[k] = one[3 + k] - one[k], other[3 + k] - other[k]
        way[k] = one[k] - other[k]
    a, b, c = dot(along, along), dot(along, across), dot(across, across)
    d, e = dot(along, way), dot(across, way)
    whole = a * c - b * b
    if whole <= _PARALLEL**2 * a * c:
        return FAR
    s, t = (b * e - c * d) / whole, (a * e - b * d) / whole
    beyond_one, beyond_other = _INSIDE / sqrt(a), _INSIDE / sqrt(c)
    outside = abs(s - 0.5) > 0.5 + beyond_one or abs(t - 0.5) > 0.5 + beyond_other
    if outside and (tilt > 0.0 or radius > 0.0):
        return FAR
    go_along(other[:3], other[3:6], t, found[3:])
    go_along(one[:3], one[3:6], s, way)
    add_times(-1.0, found[3:], way)
    if radius > 0.0:
        copy_to(way, normal)
    else:
        normal[:] = 0.0
        add_cross(1.0, along, across, normal)
    inward, square = dot(normal, other[6:9]) + dot(normal, other[9:]), dot(normal, normal)
    if square <= 1e-24:
        return FAR
    length = sqrt(square)
    if radius == 0.0 and inward > 0.0:
        length = -length
    for k in range(3):
        normal[k] /= length
    copy_to(normal, found)
    first, second = dot(normal, other[6:9]), dot(normal, other[9:])
    third, fourth = dot(normal, one[6:9]), dot(normal, one[9:])
    if max(first, second) > tilt or min(third, fourth) < -tilt:
        return FAR
    return dot(normal, way) - radius


@inner
def beyond_faces(bodies: Bodies, which: int, points: Dense) -> float:
    """Return how far points (n, 3) are all beyond one face of a hull, in its axes, at most.

    The ground of a stair has no corners: minus infinity.
    """
    hull, most = bodies.hulls[which], -np.inf
    if len(points) == 0:
        return most
    for f in range(hull[4], hull[4] + hull[5]):
        least = np.inf
        for i in range(len(points)):
            least = min(least, beyond(bodies.planes[f], points[i]))
        most = max(most, least)
    return most


@inner
def write_touch(pose: Row, gap: float, found: Row, sign: float, touch: OutRow) -> None:
    """Write a gap, the normal and the place (6,), out of a pose (12,), into a touch (7,)."""
    touch[0] = gap
    turned(pose, found[:3], touch[1:4])
    placed_at(pose, found[3:], touch[4:])
    for k in range(3):
        touch[1 + k] *= sign


@inner
def doubled(touch: OutDense, i: int) -> bool:
    """Return whether a touch (s, 7) is where one before it is."""
    for j in range(i):
        if touch[j, 0] < FAR and apart(touch[i, 4:], touch[j, 4:]) < _SAME * _SAME:
            return True
    return False


@compiled(inside=True)
def meet(bodies: Bodies, poses: Dense, pair: int, touch: OutDense) -> None:
    """Write the touches (s, 7) of a pair, see `Bodies`, in given poses of `PlacedTree`.

    None is there before.
    """
    a, b, whole = bodies.pairs[pair, 0], bodies.pairs[pair, 1], bodies.pairs[pair, 3] == 1
    one, other, shapes = bodies.hulls[a], bodies.hulls[b], bodies.shapes
    first, second, seen, back = poses[one[0]], poses[other[0]], local(12), local(12)
    middle, found, size = local(3), local(6), shapes[a, 3]
    between(second, first, seen)
    placed_at(seen, shapes[a, :3], middle)
    away = beyond_faces(bodies, b, view(middle, 0, 1, 3))
    if other[5] == 0:
        to_segment(bodies.corners[other[2]], bodies.corners[other[2] + other[3] - 1], middle, found)
        away = sqrt(apart(middle, found)) - shapes[b, 4]
    if away > 2.0 * size:
        return
    between(first, second, back)
    corners = np.empty((one[3], 3))
    for i in range(one[3]):
        placed_at(seen, bodies.corners[one[2] + i], corners[i])
    thin = min(shapes[a, 5], shapes[b, 5])
    deepest, round_a, round_b, slot = -0.5 * thin, shapes[a, 4], shapes[b, 4], 0
    theirs, edges = np.empty((other[3], 3)), np.empty((one[7], 12))
    for i in range(other[3]):
        placed_at(back, bodies.corners[other[2] + i], theirs[i])
    for f in range(one[7]):
        for k in range(0, 6, 3):
            placed_at(seen, bodies.edges[one[6] + f, k : k + 3], edges[f, k : k + 3])
            turned(seen, bodies.edges[one[6] + f, 6 + k : 9 + k], edges[f, 6 + k : 9 + k])
    if round_a + round_b == 0.0:
        # No barrier lies deeper than the hulls do: what does has its features on a far side.
        away = max(beyond_faces(bodies, a, theirs), beyond_faces(bodies, b, corners))
        for f in range(one[7] if away < size else 0):
            for e in range(other[7]):
                gap = edge_gap(edges[f], bodies.edges[other[6] + e], 0.0, 0.0, found)
                away = max(away, gap if gap < FAR else away)
        if away >= size:
            return
        deepest = max(deepest, away - _INSIDE)
    if whole:
        for i in range(len(corners)):
            ball = round_a > 0.0
            gap = corner_gap(bodies, b, corners, i, round_a, ball, deepest, size, found)
            if deepest <= gap < size:
                write_touch(second, gap, found, 1.0, touch[slot])
            slot += 1
    for i in range(len(theirs)):
        gap = corner_gap(bodies, a, theirs, i, round_b, False, deepest, size, found)
        if deepest <= gap < size:
            write_touch(first, gap, found, -1.0, touch[slot])
        slot += 1
    for f in range(one[7]):
        edge = edges[f]
        for e in range(other[7]):
            theirs_too = bodies.edges[other[6] + e]
            gap = edge_gap(edge, theirs_too, round_a + round_b, TILT, found)
            side = 0.0
            for k in range(3):
                side += (theirs_too[3 + k] - theirs_too[k]) * (edge[6 + k] + edge[9 + k])
            at = slot + 2 * e + (1 if side < 0.0 else 0)
            if deepest <= gap < min(size, touch[at, 0]):
                write_touch(second, gap, found, 1.0, touch[at])
    for i in range(one[3] if whole else 0, len(touch)):
        if touch[i, 0] < FAR and doubled(touch, i):
            touch[i, 0] = FAR
