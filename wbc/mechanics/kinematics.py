"""A robot's tree of bodies as plain arrays, and where they are, in compiled loops.

These are placements, Jacobian columns, and motion along joints.

Spatial vectors are (linear, angular) in world axes about one point that all bodies share, the
place of a base, so that sums over bodies are plain sums.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Dense, OutDense, OutRow, OutTable, Row, Table, compiled, inner, local
from wbc.errors import SimulationError
from wbc.mechanics.linear import add_cross, add_times, copy_to, dot
from wbc.structures import structured

REVOLUTE, UNBOUNDED, PRISMATIC, FREE_FLYER = range(4)
"""Joints that the loops know: about an axis, the same with q as cos and sin, along one, free."""

JOINT, FRAME, FIRST, ROWS, PLACES = range(5)
"""Columns of a table of free bases: numbers in the tree, first row of v and how many (6, or 3 of a
planar one), first entry of q."""

_KINDS = {
    **{f"JointModelR{axis}": REVOLUTE for axis in "XYZ"},
    **{f"JointModelRUB{axis}": UNBOUNDED for axis in "XYZ"},
    **{f"JointModelP{axis}": PRISMATIC for axis in "XYZ"},
    "JointModelRevoluteUnaligned": REVOLUTE,
    "JointModelPrismaticUnaligned": PRISMATIC,
    "JointModelFreeFlyer": FREE_FLYER,
}


@structured
class Tree(NamedTuple):
    """The bodies and joints of a robot; joint i here is joint i + 1 of pinocchio's.

    Attributes:
        joints: (n, 5) parent (-1 for the world), kind, first entry of q, first row of v, and the
            joint at the root of its tree.
        shapes: (n, 28) placement on the parent (rotation by rows, then place), axis, mass, centre
            of mass, inertia about it by rows; all in the axes of parent or joint.
        rows: (nv, 2) joint of each row of v, and the row before it on the way to the root (-1).
        gravity: (3,) [m/s^2].
    """

    joints: OutTable
    shapes: OutDense
    rows: OutTable
    gravity: OutRow


def joints_of(model: Any) -> tuple[IntArray, FloatArray]:
    """Return `joints` and `shapes` of a pinocchio model's `Tree`, without axes.

    Kind -1 is not known to the loops.
    """
    count = model.njoints - 1
    joints, shapes = np.zeros((count, 5), dtype=np.int64), np.zeros((count, 28))
    for i in range(count):
        joint, place = model.joints[i + 1], model.jointPlacements[i + 1]
        body = model.inertias[i + 1]
        kind, parent = _KINDS.get(joint.shortname(), -1), int(model.parents[i + 1]) - 1
        root = i if parent < 0 else joints[parent, 4]
        joints[i] = parent, kind, joint.idx_q, joint.idx_v, root
        shapes[i, :9], shapes[i, 9:12] = place.rotation.ravel(), place.translation
        shapes[i, 15], shapes[i, 16:19] = body.mass, body.lever
        shapes[i, 19:] = body.inertia.ravel()
    return joints, shapes


def tree_of(model: Any) -> Tree:
    """Return the tree of a pinocchio model.

    Raises:
        SimulationError: it has a joint of a kind that the loops do not know.
    """
    (joints, shapes), data = joints_of(model), model.createData()
    if (joints[:, 1] < 0).any():
        kinds = sorted({joint.shortname() for joint in list(model.joints)[1:]})
        raise SimulationError(
            f"the robot has a joint of a kind that the plant does not know, among "
            f"{', '.join(kinds)}; it knows joints about and along an axis, and free ones."
        )
    rows = np.full((model.nv, 2), -1, dtype=np.int64)
    for i, (parent, kind, _, first, _) in enumerate(joints.tolist()):
        if kind != FREE_FLYER:
            motion = np.asarray(data.joints[i + 1].S).reshape(6, -1)[:, 0]
            shapes[i, 12:15] = motion[:3] if kind == PRISMATIC else motion[3:]
        before = -1 if parent < 0 else int(joints[parent, 3]) + model.joints[parent + 1].nv - 1
        for row in range(first, first + model.joints[i + 1].nv):
            rows[row] = i, before
            before = row
    return Tree(joints, shapes, rows, np.array(model.gravity.linear))


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
    """Write the poses (n, 12) of a `Tree` at q (nq,): rotation (9 by rows) and place (3), world."""
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
    """Write the motion of the tree behind each joint per unit of each row of v, (nv, 6).

    Spatial vectors are about a point (3,) in the world; `joints` and `shapes` are of the `Tree`.
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
    half, rest = np.sin(0.5 * angle) / angle if angle > 0.0 else 0.5, np.cos(0.5 * angle)
    if angle > 1e-2:
        second = (angle - np.sin(angle)) / (square * angle)
    else:  # below 1e-2 rad the next term of the series is less than 1e-16
        second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0
    add_cross(1.0, turning, way, across)
    add_times(2.0 * half * half, across, way)
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
