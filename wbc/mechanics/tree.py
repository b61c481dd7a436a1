"""A robot's tree of bodies as plain arrays, for compiled loops."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import OutDense, OutRow, OutTable
from wbc.errors import SimulationError
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
        shapes: (n, 25) placement on the parent (rotation by rows, then place), axis, mass, centre
            of mass, inertia about it (xx, xy, xz, yy, yz, zz); all in the axes of parent or joint.
        rows: (nv, 2) joint of each row of v, and the row before it on the way to the root (-1).
        gravity: (3,) [m/s^2].
    """

    joints: OutTable
    shapes: OutDense
    rows: OutTable
    gravity: OutRow


def joints_of(model: Any) -> tuple[IntArray, FloatArray]:
    """Return `joints` and `shapes` of a `Tree`, without axes; kind -1 is not known to the loops.

    Args:
        model: pinocchio's.
    """
    count = model.njoints - 1
    joints, shapes = np.zeros((count, 5), dtype=np.int64), np.zeros((count, 25))
    for i in range(count):
        joint, place = model.joints[i + 1], model.jointPlacements[i + 1]
        body = model.inertias[i + 1]
        kind, parent = _KINDS.get(joint.shortname(), -1), int(model.parents[i + 1]) - 1
        root = i if parent < 0 else joints[parent, 4]
        joints[i] = parent, kind, joint.idx_q, joint.idx_v, root
        shapes[i, :9], shapes[i, 9:12] = place.rotation.ravel(), place.translation
        shapes[i, 15], shapes[i, 16:19] = body.mass, body.lever
        shapes[i, 19:] = body.inertia[np.triu_indices(3)]
    return joints, shapes


def tree_of(model: Any) -> Tree:
    """Return the tree of a pinocchio model.

    Args:
        model: pinocchio's.

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
