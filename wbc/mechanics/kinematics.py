"""Where the bodies of a tree are: placements, Jacobian columns, and motion along joints.

Spatial vectors are (linear, angular) in world axes about one point that all bodies share, the
place of a base, so that sums over bodies are plain sums.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, Table, compiled, inner, local
from wbc.mechanics.tree import FREE_FLYER, PRISMATIC, REVOLUTE


@inner
def turned(pose: Row, way: Row, out: OutRow) -> None:
    """Write a direction (3,) in the outer axes of a pose (9,) or (12,)."""
    for k in range(3):
        out[k] = pose[3 * k] * way[0] + pose[3 * k + 1] * way[1] + pose[3 * k + 2] * way[2]


@inner
def placed_at(pose: Row, point: Row, out: OutRow) -> None:
    """Write a point (3,) in the outer axes of a pose (12,)."""
    turned(pose, point, out)
    for k in range(3):
        out[k] += pose[9 + k]


@inner
def _about_axis(axis: Row, cos: float, sin: float, turn: OutRow) -> None:
    """Write the rotation (9,) about a unit axis (3,)."""
    x, y, z, rest = axis[0], axis[1], axis[2], 1.0 - cos
    turn[0], turn[1], turn[2] = cos + rest * x * x, rest * x * y - sin * z, rest * x * z + sin * y
    turn[3], turn[4], turn[5] = rest * x * y + sin * z, cos + rest * y * y, rest * y * z - sin * x
    turn[6], turn[7], turn[8] = rest * x * z - sin * y, rest * y * z + sin * x, cos + rest * z * z


@inner
def _of_quaternion(quaternion: Row, turn: OutRow) -> None:
    """Write the rotation (9,) of a quaternion (x, y, z, w)."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    turn[0], turn[1], turn[2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    turn[3], turn[4], turn[5] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    turn[6], turn[7], turn[8] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@inner
def product(left: Row, right: Row, turn: OutRow) -> None:
    """Write the product (9,) of two rotations, each the first nine of its numbers."""
    for i in range(3):
        for j in range(3):
            turn[3 * i + j] = left[3 * i] * right[j] + left[3 * i + 1] * right[3 + j]
            turn[3 * i + j] += left[3 * i + 2] * right[6 + j]


@compiled(counted=False)
def place(joints: Table, shapes: Dense, q: Row, poses: OutDense) -> None:
    """Write the pose of every joint: rotation (9 by rows) and place (3), world.

    Args:
        joints, shapes: of the `Tree`.
        q: (nq,).
        poses: (n, 12) to write.
    """
    own, mounted, way = local(9), local(9), local(3)
    for i in range(len(joints)):
        parent, kind, at = joints[i, 0], joints[i, 1], joints[i, 2]
        shape, pose = shapes[i], poses[i]
        if parent < 0:
            for k in range(9):
                mounted[k] = shape[k]
            for k in range(9, 12):
                pose[k] = shape[k]
        else:
            product(poses[parent, :9], shape[:9], mounted)
            placed_at(poses[parent], shape[9:12], pose[9:])
        if kind == PRISMATIC:
            turned(mounted, shape[12:15], way)
            for k in range(9):
                pose[k] = mounted[k]
            for k in range(3):
                pose[9 + k] += way[k] * q[at]
            continue
        if kind == FREE_FLYER:
            turned(mounted, q[at : at + 3], way)
            for k in range(3):
                pose[9 + k] += way[k]
            _of_quaternion(q[at + 3 : at + 7], own)
        elif kind == REVOLUTE:
            _about_axis(shape[12:15], np.cos(q[at]), np.sin(q[at]), own)
        else:
            _about_axis(shape[12:15], q[at], q[at + 1], own)
        product(mounted, own, pose[:9])


@compiled(counted=False)
def columns_at(joints: Table, shapes: Dense, poses: Dense, about: Row, columns: OutDense) -> None:
    """Write the motion of the tree behind each joint per unit of each row of v.

    Args:
        joints, shapes: of the `Tree`.
        poses: (n, 12).
        about: (3,) the point of the spatial vectors, world.
        columns: (nv, 6) to write.
    """
    for i in range(len(joints)):
        kind, row, pose, shape = joints[i, 1], joints[i, 3], poses[i], shapes[i]
        x, y, z = pose[9] - about[0], pose[10] - about[1], pose[11] - about[2]
        if kind == FREE_FLYER:
            for k in range(3):
                a, b, c = pose[k], pose[3 + k], pose[6 + k]
                columns[row + k, 0], columns[row + k, 1], columns[row + k, 2] = a, b, c
                columns[row + k, 3:] = 0.0
                turning = columns[row + 3 + k]
                turning[0], turning[1], turning[2] = y * c - z * b, z * a - x * c, x * b - y * a
                turning[3], turning[4], turning[5] = a, b, c
            continue
        a = pose[0] * shape[12] + pose[1] * shape[13] + pose[2] * shape[14]
        b = pose[3] * shape[12] + pose[4] * shape[13] + pose[5] * shape[14]
        c = pose[6] * shape[12] + pose[7] * shape[13] + pose[8] * shape[14]
        column = columns[row]
        if kind == PRISMATIC:
            column[0], column[1], column[2] = a, b, c
            column[3:] = 0.0
        else:
            column[0], column[1], column[2] = y * c - z * b, z * a - x * c, x * b - y * a
            column[3], column[4], column[5] = a, b, c


@inner
def _fly(q: Row, v: Row, time: float, moved: OutRow) -> None:
    """Write the pose (7,) after flying with the constant body velocity v (6,): SE(3)'s exponential.

    With w = time * angular, its size t, and the linear part u: the place moves by
    R (u + (1 - cos t)/t^2 w x u + (t - sin t)/t^3 w x (w x u)).
    """
    ux, uy, uz = time * v[0], time * v[1], time * v[2]
    wx, wy, wz = time * v[3], time * v[4], time * v[5]
    square = wx * wx + wy * wy + wz * wz
    angle = np.sqrt(square)
    if angle > 1e-2:
        first, second = (1.0 - np.cos(angle)) / square, (angle - np.sin(angle)) / (square * angle)
        half, rest = np.sin(0.5 * angle) / angle, np.cos(0.5 * angle)
    else:  # series: below 1e-2 rad the next terms are less than 1e-16
        first = 0.5 - square / 24.0 + square * square / 720.0 - square**3 / 40320.0
        second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0 - square**3 / 362880.0
        half = 0.5 - square / 48.0 + square * square / 3840.0 - square**3 / 645120.0
        rest = 1.0 - square / 8.0 + square * square / 384.0 - square**3 / 46080.0
    cx, cy, cz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    dx = ux + first * cx + second * (wy * cz - wz * cy)
    dy = uy + first * cy + second * (wz * cx - wx * cz)
    dz = uz + first * cz + second * (wx * cy - wy * cx)
    turn = local(9)
    _of_quaternion(q[3:], turn)
    for k in range(3):
        moved[k] = q[k] + turn[3 * k] * dx + turn[3 * k + 1] * dy + turn[3 * k + 2] * dz
    x, y, z, w = q[3], q[4], q[5], q[6]
    a, b, c = half * wx, half * wy, half * wz
    moved[3] = w * a + x * rest + y * c - z * b
    moved[4] = w * b + y * rest + z * a - x * c
    moved[5] = w * c + z * rest + x * b - y * a
    moved[6] = w * rest - x * a - y * b - z * c
    size = np.sqrt(moved[3] ** 2 + moved[4] ** 2 + moved[5] ** 2 + moved[6] ** 2)
    for k in range(3, 7):
        moved[k] /= size


@compiled(counted=False)
def moved_along(joints: Table, q: Row, v: Row, time: float, moved: OutRow) -> None:
    """Write the configuration (nq,) that v (nv,) leads to from q (nq,) in `time`."""
    for i in range(len(joints)):
        kind, at, row = joints[i, 1], joints[i, 2], joints[i, 3]
        if kind == FREE_FLYER:
            _fly(q[at : at + 7], v[row : row + 6], time, moved[at : at + 7])
        elif kind in (REVOLUTE, PRISMATIC):
            moved[at] = q[at] + time * v[row]
        else:
            cos, sin = np.cos(time * v[row]), np.sin(time * v[row])
            x, y = q[at] * cos - q[at + 1] * sin, q[at] * sin + q[at + 1] * cos
            size = np.sqrt(x * x + y * y)
            moved[at], moved[at + 1] = x / size, y / size
