"""Where faces and edges of convex hulls touch a height field that sticks out between their corners.

Where the field is convex, nodes of its grid are corners of the ground and lines between them edges:
a face of a hull meets nodes, an edge of a hull lines. Each node within reach, and each line that an
edge may cross, has its own barrier, so that a contact keeps its identity. Between lines the field
may stick out further, by up to an eighth of its curvature times the spacing squared, per axis.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Count, Nothing, Number, OutDense, Row, compiled, local
from wbc.sim.step.pairs import FAR, TILT, corner_gap, edge_gap, pose_of, turned, write_touch
from wbc.sim.step.tables import BODIES, OPENED, Bodies, Opened

_BULGE = 1e-7  # [m] of a place above the line through those beside it; less is flat


@compiled(Count, Row, Count, Count, Number, counted=False)
def first_line(field: FloatArray, first: int, count: int, at: float) -> int:
    """Return the first inner line beyond a place of an axis (count,) that begins at `first`."""
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if field[first + middle] <= at:
            low = middle
        else:
            high = middle
    return low + 1 if field[first] <= at else 1


@compiled(Number, Row, Count, Count, Count, counted=False)
def bulge(field: FloatArray, first: int, step: int, node: int) -> float:
    """Return how far a node [m] is above the line between its neighbours along an axis.

    Args:
        field: see `wbc.sim.step.field`.
        first: where the node is on this axis.
        step: from its height to that of the next one.
        node: where its height is.
    """
    before, after = field[first] - field[first - 1], field[first + 1] - field[first]
    line = (after * field[node - step] + before * field[node + step]) / (before + after)
    height: float = field[node] - line
    return height


@compiled(Nothing, BODIES, Row, Row, Count, OutDense)
def meet_nodes(
    bodies: Bodies, field: FloatArray, pose: FloatArray, pair: int, touch: FloatArray
) -> None:
    """Write the touches of a pair's hull, in a pose (12,), with the nodes of its field."""
    which, size, a, b = bodies.pairs[pair, 0], bodies.pairs[pair, 6], int(field[1]), int(field[2])
    heights, block, middle, way, found = 3 + a + b, np.empty((9, 3)), local(3), local(3), local(6)
    reach, deepest = bodies.shapes[which, 3], -0.5 * bodies.shapes[which, 5]
    turned(pose, bodies.shapes[which, :3], middle)
    for k in range(3):
        middle[k] += pose[9 + k]
    for i in range(first_line(field, 3, a, middle[0] - reach), a - 1):
        if field[3 + i] > middle[0] + reach:
            break
        for j in range(first_line(field, 3 + a, b, middle[1] - reach), b - 1):
            node = heights + i * b + j
            if field[3 + a + j] > middle[1] + reach:
                break
            if abs(field[node] - middle[2]) > reach:
                continue
            along, across = bulge(field, 3 + i, b, node), bulge(field, 3 + a + j, 1, node)
            if min(along, across) < -_BULGE or max(along, across) < _BULGE:
                continue
            for n in range(9):
                p, q = i + n // 3 - 1, j + n % 3 - 1
                way[0], way[1] = field[3 + p] - pose[9], field[3 + a + q] - pose[10]
                way[2] = field[heights + p * b + q] - pose[11]
                for k in range(3):
                    block[n, k] = pose[k] * way[0] + pose[3 + k] * way[1] + pose[6 + k] * way[2]
            gap = corner_gap(bodies, which, block, 4, 0.0, False, deepest, reach, found)
            if deepest <= gap < reach:
                write_touch(pose, gap, found, -1.0, touch[i % size * size + j % size])


@compiled(Number, Row, Count, Count, Number, counted=False)
def height_on(field: FloatArray, axis: int, i: int, at: float) -> float:
    """Return the height [m] of a line i of an axis, straight between nodes, at a place along it."""
    a, b = int(field[1]), int(field[2])
    first, count, over, along = (3 + a, b, b, 1) if axis == 0 else (3, a, 1, b)
    j = min(first_line(field, first, count, at), count - 1) - 1
    part = (at - field[first + j]) / (field[first + j + 1] - field[first + j])
    part, node = min(max(part, 0.0), 1.0), 3 + a + b + i * over + j * along
    height: float = field[node] + part * (field[node + along] - field[node])
    return height


@compiled(Nothing, BODIES, Row, Row, Count, OutDense, counted=False)
def meet_lines(
    bodies: Bodies, field: FloatArray, pose: FloatArray, pair: int, touch: FloatArray
) -> None:
    """Write the touches of the edges of a pair's hull, in a pose (12,), with lines of its field."""
    a, b, which, size = int(field[1]), int(field[2]), bodies.pairs[pair, 0], bodies.pairs[pair, 7]
    hull, shape, edge, line = bodies.hulls[which], bodies.shapes[which], local(12), local(12)
    found = local(6)
    for f in range(2 * hull[7]):
        axis, other = f % 2, 1 - f % 2
        for k in range(0, 12, 3):
            turned(pose, bodies.edges[hull[6] + f // 2, k : k + 3], edge[k : k + 3])
        for k in range(6):
            edge[k] += pose[9 + k % 3]
        own, beside, count, width = (3, 3 + a, a, b) if axis == 0 else (3 + a, 3, b, a)
        over, along = (b, 1) if axis == 0 else (1, b)
        low, high = min(edge[axis], edge[3 + axis]), max(edge[axis], edge[3 + axis])
        for i in range(first_line(field, own, count, low), count - 1):
            if field[own + i] >= high:
                break
            way = edge[3 + axis] - edge[axis]
            share, turn = (field[own + i] - edge[axis]) / way, (edge[3 + other] - edge[other]) / way
            at = edge[other] + share * (edge[3 + other] - edge[other])
            height, turn = height_on(field, axis, i, at), min(max(turn, -1.0), 1.0)
            if abs(edge[2] + share * (edge[5] - edge[2]) - height) > shape[3]:
                continue
            # The ground along the edge, on the lines before and after this one.
            for n in range(2):
                step = field[own + i + 2 * n - 1] - field[own + i]
                side, drop = 6 + 3 * n, height_on(field, axis, i + 2 * n - 1, at + turn * step)
                line[side + axis], line[side + other], line[side + 2] = step, turn * step, drop
                line[side + 2] -= height
            if line[8] * line[9 + axis] - line[11] * line[6 + axis] > -_BULGE * line[9 + axis]:
                continue
            for n in range(2):
                side, square = 6 + 3 * n, 0.0
                for k in range(3):
                    square += line[side + k] ** 2
                for k in range(3):
                    line[side + k] /= sqrt(square)
            j, one = first_line(field, beside, width, at) - 1, touch[f * size + i % size]
            for m in range(max(j - 1, 0), min(j + 2, width - 1)):
                for n in range(2):
                    node = 3 + a + b + i * over + (m + n) * along
                    line[3 * n + axis], line[3 * n + other] = field[own + i], field[beside + m + n]
                    line[3 * n + 2] = field[node]
                gap = edge_gap(edge, line, shape[4], TILT, found)
                if -0.5 * shape[5] <= gap < min(shape[3], one[0]):
                    one[0] = gap
                    for k in range(6):
                        one[1 + k] = found[k]


@compiled(Nothing, OPENED, Count, counted=False)
def meet_fields(plant: Opened, first: int) -> None:
    """Write the touches of all pairs with fields, as `meet_all` does those of all other pairs."""
    bodies, pose = plant.bodies, local(12)
    for pair in range(len(bodies.pairs)):
        own = bodies.pairs[pair]
        if own[5] < 0:
            continue
        touch, field = plant.obstacles.touch, plant.obstacles.solids[own[5]]
        start, end, nodes = first + own[2], first + own[4], own[6] * own[6]
        for i in range(start, end):
            touch[i] = 0.0
            touch[i, 0], touch[i, 3] = FAR, 1.0
        pose_of(plant.placed.poses, bodies.hulls[own[0], 0], pose)
        meet_nodes(bodies, field, pose, pair, touch[start : start + nodes])
        meet_lines(bodies, field, pose, pair, touch[start + nodes : end])
