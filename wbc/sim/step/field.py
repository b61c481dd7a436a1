"""Ground given by heights on a grid, for compiled loops: the nearest place of a smooth surface.

A field is a row of numbers like any solid: FIELD, the lengths a and b of both axes, the largest
curvature [1/m], the mean spacing of the finer axis [m], from AXES on x (a,) and y (b,), then for
each of the nodes (a, b) height, slopes along x and along y, and mixed derivative, and for each of
the cells (a - 1, b - 1) height and both slopes in its middle, and its own largest curvature.
Between nodes there is one bicubic (Hermite) patch per cell; the surface is level beyond its border.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import OutRow, Row, inner, local
from wbc.mechanics.linear import apart
from wbc.sim.step.pairs import to_segment

BEND, SPACING, AXES = 3, 4, 5
AHEAD = 0.02
"""[m] up to which gaps are known at most before they close: 20 m/s in steps of 1 ms."""
_ROUNDS = 20  # of Newton's iteration, which settles in 1 to 4 where a place is near
_FLAT = 1e-5  # share of a curvature beside which another one is none
_SETTLED = 1e-6  # [m]; the next step would be about this, squared, over the radius of curvature


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
