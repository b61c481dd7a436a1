"""Ground given by heights on a grid, for compiled loops: the nearest place of a smooth surface.

A field is a row of numbers like any solid: FIELD, the lengths a and b of both axes, x (a,), y (b,),
then the heights (a, b) at the nodes, their slopes along x and along y, and their mixed derivatives.
Between nodes these make one bicubic (Hermite) patch per cell; the surface is level beyond its
border.
"""

from __future__ import annotations

from math import sqrt

from wbc.arrays import FloatArray
from wbc.compiled import Count, Nothing, Number, OutRow, Row, compiled, local

_ROUNDS = 12  # of Newton's iteration, which settles in 1 to 4 where a place is near
_SETTLED = 1e-7  # [m]; the next step would be about this, squared, over the radius of curvature


@compiled(Count, Row, Count, Count, Number, OutRow, counted=False)
def cubics(field: FloatArray, first: int, count: int, at: float, found: FloatArray) -> int:
    """Write Hermite's cubics at a place of an axis; return the cell.

    Args:
        field: with the axis (count,) from `first` on.
        first, count: see above.
        at: place on the axis; beyond its ends the end, where all derivatives are zero.
        found: (12,) to write: weights of value and slope at the cell's start, then at its end;
            their first derivatives; their second ones.
    """
    low, high = 0, count - 1
    inside = field[first] <= at <= field[first + high]
    place = min(max(at, field[first]), field[first + high])
    while high - low > 1:
        middle = (low + high) // 2
        if field[first + middle] <= place:
            low = middle
        else:
            high = middle
    width = field[first + low + 1] - field[first + low]
    s = (place - field[first + low]) / width
    found[0], found[1] = (1.0 + 2.0 * s) * (1.0 - s) ** 2, s * (1.0 - s) ** 2 * width
    found[2], found[3] = s * s * (3.0 - 2.0 * s), s * s * (s - 1.0) * width
    one, two = (1.0 / width, 1.0 / width**2) if inside else (0.0, 0.0)
    found[4], found[6] = 6.0 * s * (s - 1.0) * one, 6.0 * s * (1.0 - s) * one
    found[5] = (1.0 - s) * (1.0 - 3.0 * s) * width * one
    found[7] = s * (3.0 * s - 2.0) * width * one
    found[8], found[10] = (12.0 * s - 6.0) * two, (6.0 - 12.0 * s) * two
    found[9], found[11] = (6.0 * s - 4.0) * width * two, (6.0 * s - 2.0) * width * two
    return low


@compiled(Nothing, Row, Number, Number, OutRow, counted=False)
def surface_at(field: FloatArray, x: float, y: float, found: FloatArray) -> None:
    """Write z, its slopes along x and y, and its derivatives xx, xy and yy (6,) at a place."""
    a, b = int(field[1]), int(field[2])
    along_x, along_y = local(12), local(12)
    i, j = cubics(field, 3, a, x, along_x), cubics(field, 3 + a, b, y, along_y)
    nodes, size = 3 + a + b, a * b
    found[:] = 0.0
    for p in range(4):
        for q in range(4):
            which = p % 2 + 2 * (q % 2)
            node = field[nodes + which * size + (i + p // 2) * b + j + q // 2]
            u, v = along_x[p] * node, along_y[q]
            found[0] += u * v
            found[1] += along_x[4 + p] * node * v
            found[2] += u * along_y[4 + q]
            found[3] += along_x[8 + p] * node * v
            found[4] += along_x[4 + p] * node * along_y[4 + q]
            found[5] += u * along_y[8 + q]


@compiled(Number, Row, Row, OutRow, counted=False)
def field_gap(field: FloatArray, point: FloatArray, normal: FloatArray) -> float:
    """Return the distance of a point (3,) from a field, and write the way out (3,).

    The way from the nearest place of the surface is at right angles to it there,
    (x, y) - p_xy + (z - p_z) grad z = 0. Where Newton's iteration does not settle at a least
    distance (a point above a hollow is as near to two sides), or finds a place that is farther
    away, the place is straight below the point.
    """
    at, x, y, first, deep, settled = local(6), point[0], point[1], 0.0, 0.0, False
    for turn in range(_ROUNDS):
        surface_at(field, x, y, at)
        deep = at[0] - point[2]
        if turn == 0:
            first = deep
        a, b = 1.0 + at[1] * at[1] + deep * at[3], at[1] * at[2] + deep * at[4]
        d = 1.0 + at[2] * at[2] + deep * at[5]
        whole = a * d - b * b
        if not (whole > 0.0 and a > 0.0):
            break
        off_x, off_y = x - point[0] + deep * at[1], y - point[1] + deep * at[2]
        step_x, step_y = (d * off_x - b * off_y) / whole, (a * off_y - b * off_x) / whole
        x, y = x - step_x, y - step_y
        settled = max(abs(step_x), abs(step_y)) <= _SETTLED
        if settled:
            break
    away = (x - point[0]) ** 2 + (y - point[1]) ** 2 + deep * deep
    if not (settled and deep * first >= 0.0 and away <= first * first):
        x, y = point[0], point[1]
    surface_at(field, x, y, at)
    size = sqrt(1.0 + at[1] * at[1] + at[2] * at[2])
    normal[0], normal[1], normal[2] = -at[1] / size, -at[2] / size, 1.0 / size
    gap: float = (point[2] - at[0]) * normal[2]
    gap += (point[0] - x) * normal[0] + (point[1] - y) * normal[1]
    return gap
