"""Where the bodies of a tree are: placements, Jacobian columns, and motion along joints.

Spatial vectors are (linear, angular) in world axes about one point that all bodies share, the
place of a base, so that sums over bodies are plain sums.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, Table, compiled, inner, local
from wbc.mechanics.linear import add_cross, add_times, copy_to, dot
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
    add_times(1.0, pose[9:], out)


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
            copy_to(shape[:9], mounted)
            copy_to(shape[9:12], pose[9:])
        else:
            product(poses[parent, :9], shape[:9], mounted)
            placed_at(poses[parent], shape[9:12], pose[9:])
        if kind == PRISMATIC:
            turned(mounted, shape[12:15], way)
            copy_to(mounted, pose)
            add_times(q[at], way, pose[9:])
            continue
        if kind == FREE_FLYER:
            turned(mounted, q[at : at + 3], way)
            add_times(1.0, way, pose[9:])
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
    axis, arm = local(3), local(3)
    columns[:] = 0.0
    for i in range(len(joints)):
        kind, row, pose = joints[i, 1], joints[i, 3], poses[i]
        copy_to(pose[9:], arm)
        add_times(-1.0, about, arm)
        turned(pose, shapes[i, 12:15], axis)
        for k in range(3 if kind == FREE_FLYER else 1):
            turning = row
            if kind == FREE_FLYER:
                axis[0], axis[1], axis[2], turning = pose[k], pose[3 + k], pose[6 + k], row + 3
            if kind in (FREE_FLYER, PRISMATIC):
                copy_to(axis, columns[row + k])
            if kind != PRISMATIC:
                add_cross(1.0, arm, axis, columns[turning + k])
                copy_to(axis, columns[turning + k, 3:])


@inner
def _fly(q: Row, v: Row, time: float, moved: OutRow) -> None:
    """Write the pose (7,) after flying with the constant body velocity v (6,): SE(3)'s exponential.

    With w = time * angular, its size t, and the linear part u: the place moves by
    R (u + (1 - cos t)/t^2 w x u + (t - sin t)/t^3 w x (w x u)).
    """
    way, turning, across, turn = local(3), local(3), local(3), local(9)
    for k in range(3):
        way[k], turning[k], across[k] = time * v[k], time * v[3 + k], 0.0
    square = dot(turning, turning)
    angle = np.sqrt(square)
    if angle > 1e-2:
        first, second = (1.0 - np.cos(angle)) / square, (angle - np.sin(angle)) / (square * angle)
        half, rest = np.sin(0.5 * angle) / angle, np.cos(0.5 * angle)
    else:  # series: below 1e-2 rad the next terms are less than 1e-16
        first = 0.5 - square / 24.0 + square * square / 720.0 - square**3 / 40320.0
        second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0 - square**3 / 362880.0
        half = 0.5 - square / 48.0 + square * square / 3840.0 - square**3 / 645120.0
        rest = 1.0 - square / 8.0 + square * square / 384.0 - square**3 / 46080.0
    add_cross(1.0, turning, way, across)
    add_times(first, across, way)
    add_cross(second, turning, across, way)
    _of_quaternion(q[3:], turn)
    turned(turn, way, moved)
    add_times(1.0, q[:3], moved)
    for k in range(3):
        moved[3 + k] = rest * q[3 + k] + half * q[6] * turning[k]
    add_cross(half, q[3:], turning, moved[3:])
    moved[6] = rest * q[6] - half * dot(turning, q[3:])
    size = np.sqrt(dot(moved[3:], moved[3:]))
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
