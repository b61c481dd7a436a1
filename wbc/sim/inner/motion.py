"""From the start of a part to its middle, and on to its end, with the momentum of free bases.

The same steps as `wbc.sim.step.flight`, which says why, on arrays alone.
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Count, Dense, Nothing, Number, OutDense, OutRow, Row, Table, compiled
from wbc.sim.step.momentum import momentum_at, velocity_at
from wbc.sim.tree.inertia import bodies_at, inertia_at
from wbc.sim.tree.kinematics import columns_at, moved_along, place

JOINT, FRAME, FIRST, PLANAR, PLACES = range(5)
"""Columns of a table of free bases: numbers in the tree, first row of v, flag, first entry of q."""


@compiled(Nothing, Table, Dense, OutRow)
def point_of_reference(bases: IntArray, poses: FloatArray, about: FloatArray) -> None:
    """Write the point (3,) of all spatial vectors: the first free base, or the first joint."""
    joint = bases[0, FRAME] if len(bases) else 0
    for k in range(3):
        about[k] = poses[joint, 9 + k]


@compiled(Nothing, Table, Dense, Table, Table, Count, Dense, OutDense, OutDense, OutDense, OutDense)
def look(
    joints: IntArray,
    shapes: FloatArray,
    rows: IntArray,
    bases: IntArray,
    upto: int,
    poses: FloatArray,
    columns: FloatArray,
    bodies: FloatArray,
    composite: FloatArray,
    inertia: FloatArray,
) -> None:
    """Write the columns, bodies and the first `upto` rows of H_l of a tree in given poses."""
    about = np.empty(3)
    point_of_reference(bases, poses, about)
    columns_at(joints, shapes, poses, about, columns)
    bodies_at(joints, shapes, poses, about, bodies, composite)
    inertia_at(rows, composite, columns, upto, inertia)


@compiled(Nothing, Table, Count, Dense, Dense, OutDense, OutRow)
def base_frame(
    bases: IntArray,
    which: int,
    poses: FloatArray,
    composite: FloatArray,
    turn: FloatArray,
    lever: FloatArray,
) -> None:
    """Write the rotation (3, 3) of a free base and the way (3,) from it to the centre of mass."""
    joint, frame, about = bases[which, JOINT], bases[which, FRAME], np.empty(3)
    point_of_reference(bases, poses, about)
    for i in range(3):
        for j in range(3):
            turn[i, j] = poses[frame, 3 * i + j]
        center = about[i] + composite[joint, 1 + i] / composite[joint, 0]
        lever[i] = center - poses[frame, 9 + i]


@compiled(Nothing, Table, Dense, Dense, Dense, Dense, OutRow)
def set_momentum(
    bases: IntArray,
    poses: FloatArray,
    composite: FloatArray,
    inertia: FloatArray,
    carried: FloatArray,
    v: FloatArray,
) -> None:
    """Change the bases' rows of v (nv,) so that every tree has the momentum of `carried`."""
    turn, lever = np.empty((3, 3)), np.empty(3)
    for i in range(len(bases)):
        base_frame(bases, i, poses, composite, turn, lever)
        planar = bases[i, PLANAR] == 1
        velocity_at(inertia, turn, lever, bases[i, FIRST], planar, carried[i, :6], v)


@compiled(Nothing, Table, Table, Dense, Number, OutDense, OutRow, OutDense)
def advance(
    joints: IntArray,
    bases: IntArray,
    shapes: FloatArray,
    half: float,
    carried: FloatArray,
    q: FloatArray,
    poses: FloatArray,
) -> None:
    """Move the bases in q and poses so that each centre of mass has moved in a straight line.

    Args:
        joints, bases, shapes: of the tree.
        half: time [s] that the centres of mass move on.
        carried: (b, 10) momentum (6), centre of mass (3), changed, and mass.
        q: (nq,), changed.
        poses: (n, 12), changed.
    """
    for i in range(len(bases)):
        joint, missing = bases[i, JOINT], np.zeros(3)
        for body in range(len(joints)):
            if joints[body, 4] == joint:
                pose, shape = poses[body], shapes[body]
                for k in range(3):
                    way = pose[3 * k] * shape[16] + pose[3 * k + 1] * shape[17]
                    way += pose[3 * k + 2] * shape[18]
                    missing[k] -= shape[15] * (pose[9 + k] + way)
        for k in range(3):
            carried[i, 6 + k] += half / carried[i, 9] * carried[i, k]
            missing[k] = carried[i, 6 + k] + missing[k] / carried[i, 9]
        if bases[i, PLANAR] == 1:
            missing[1] = 0.0
            q[bases[i, PLACES]] += missing[0]
            q[bases[i, PLACES] + 1] += missing[2]
        else:
            for k in range(3):
                q[bases[i, PLACES] + k] += missing[k]
        for body in range(len(joints)):
            if joints[body, 4] == joint:
                for k in range(3):
                    poses[body, 9 + k] += missing[k]


@compiled(
    Nothing, Table, Dense, Table, Table, Row, Row, Number,
    OutDense, OutDense, OutDense, OutDense, OutDense, OutDense, OutRow, OutRow,
)  # fmt: skip
def to_middle(
    joints: IntArray,
    shapes: FloatArray,
    rows: IntArray,
    bases: IntArray,
    q: FloatArray,
    v: FloatArray,
    half: float,
    poses: FloatArray,
    columns: FloatArray,
    bodies: FloatArray,
    composite: FloatArray,
    inertia: FloatArray,
    carried: FloatArray,
    middle: FloatArray,
    speed: FloatArray,
) -> None:
    """Write q (nq,) and v (nv,) half a step later with the momentum that the robot has.

    The attitude goes by the velocity of the middle (one correction), which makes free rotation of
    second order. The memory then stands at the middle, with all of H_l.
    """
    speed[:] = v
    upto, turn, lever = 0, np.empty((3, 3)), np.empty(3)
    for i in range(len(bases)):
        upto = max(upto, bases[i, FIRST] + (3 if bases[i, PLANAR] == 1 else 6))
    if len(bases):
        place(joints, shapes, q, poses)
        look(joints, shapes, rows, bases, upto, poses, columns, bodies, composite, inertia)
        for i in range(len(bases)):
            base_frame(bases, i, poses, composite, turn, lever)
            planar, frame = bases[i, PLANAR] == 1, bases[i, FRAME]
            momentum_at(inertia, turn, lever, bases[i, FIRST], planar, v, carried[i, :6])
            for k in range(3):
                carried[i, 6 + k] = poses[frame, 9 + k] + lever[k]
            carried[i, 9] = composite[bases[i, JOINT], 0]
        moved_along(joints, q, v, half, middle)
        place(joints, shapes, middle, poses)
        look(joints, shapes, rows, bases, upto, poses, columns, bodies, composite, inertia)
        set_momentum(bases, poses, composite, inertia, carried, speed)
    moved_along(joints, q, speed, half, middle)
    place(joints, shapes, middle, poses)
    advance(joints, bases, shapes, half, carried, middle, poses)
    look(joints, shapes, rows, bases, len(rows), poses, columns, bodies, composite, inertia)
    speed[:] = v
    set_momentum(bases, poses, composite, inertia, carried, speed)
