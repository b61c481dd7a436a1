"""Motion of all joints of a tree, and rows of frames, momentum and distances on it, compiled."""

from __future__ import annotations

from enum import IntEnum
from math import atan2, sqrt
from typing import Annotated, Any

import numpy as np

from wbc.compiled import (
    Dense,
    Matrix,
    OutDense,
    OutFlags,
    OutRow,
    OutVector,
    Places,
    Row,
    Table,
    Vector,
    compiled,
)
from wbc.mechanics.inertia import bodies_at, move_bodies
from wbc.structures import Structure

TREE = Structure(
    "Tree",
    jacobian=Matrix,
    places=Dense,
    mass_matrix=Dense,
    momentum=Matrix,
    com=Vector,
    motions=Dense,
    joints=Table,
    shapes=Dense,
    gravity=Row,
    starts=Places,
    columns=Places,
    moved=OutFlags,
    poses=(OutDense, "j", 12),
    bodies=(OutDense, "j", 10),
    rates=(OutDense, "j", 6),
    drifts=(OutDense, "j", 6),
    forces=(OutDense, "j", 6),
    com_drift=(OutRow, 3),
    momentum_drift=(OutRow, 6),
    bias=(OutRow, "v"),
)
"""A robot at one state. World axes, spatial vectors at the world's origin, linear over angular.

jacobian (6, nv), momentum A_g (6, nv), places (j, 12) of joints, rotation column by column before
translation, motions (nv, 6) = J', mass_matrix (nv, nv) and com (3,) are pinocchio's own memory.
joints and shapes are those of a `wbc.mechanics.tree.Tree`, without axes and placements, behind a
world without mass; from starts on stand the columns of J that move each joint; moved (1,) says
whether the rest stands at the state, too. That `move_joints` writes.
"""
TreeMemory = Annotated[Any, TREE.kind]


class RowKind(IntEnum):
    """What rows are of.

    FRAME is the velocity of a frame's origin over its angular one, in world axes. OWN is the
    spatial velocity of a frame in its own axes. CENTER_OF_MASS is the velocity of that, MOMENTUM
    the momentum about it, linear over angular. DISTANCE is the rate of the distance between two
    frames, one row. BALANCE is the velocity of the centre of mass, steered by what
    `PointFootBalanceTask` feeds back.
    """

    FRAME, OWN, CENTER_OF_MASS, MOMENTUM, DISTANCE, BALANCE = range(6)


FRAME, OWN, CENTER_OF_MASS, MOMENTUM, DISTANCE, BALANCE = (int(kind) for kind in RowKind)
NO_DISTANCE = 1e-6
"""[m] below which a distance has no direction worth the name."""

ROWS = Structure(
    "Rows",
    plan=Table,
    offsets=Dense,
    used=Places,
    places=OutDense,
    jacobian=OutDense,
    drift=OutRow,
)
"""Rows of entries e: J (k, nv) and dJ/dt v (k,).

plan (e, 7): kind, joint, first row, first component, their number and step, the other joint;
offsets (e, 27): rotation and origin in the joint's frame, the arm of a rolling ball, rotation and
origin of the other frame; used (e,): 0 where nothing is to be written; places (e, 12): result.
"""
RowsMemory = Annotated[Any, ROWS.kind]


@compiled
def move_joints(tree: TreeMemory, velocity: Vector) -> None:
    """Write the spatial velocity V and drift A = dJ/dt v of every joint, and what follows, once.

    The sum of all forces, taken about the centre of mass and without the weight, is dA_g/dt v.

    Args:
        tree: a TREE whose pinocchio part stands at the state.
        velocity: v (nv,).
    """
    if tree.moved[0]:
        return
    tree.moved[0] = True
    places, poses, whole = tree.places, tree.poses, tree.momentum_drift
    com, force, gravity = tree.com, tree.forces[0], tree.gravity
    for i in range(1, len(places)):
        for a in range(3):
            for b in range(3):
                poses[i, 3 * a + b] = places[i, 3 * b + a]
            poses[i, 9 + a] = places[i, 9 + a]
    bodies_at(tree.joints, tree.shapes, poses, tree.poses[0, 9:], tree.bodies)
    moved = tree.rates, tree.drifts, tree.forces
    move_bodies(tree.joints, gravity, tree.motions, tree.bodies, velocity, *moved, tree.bias)
    mass = 0.0
    for i in range(len(tree.bodies)):
        mass += tree.bodies[i, 0]
    for k in range(3):
        whole[k] = force[k] + mass * gravity[k]
        tree.com_drift[k] = whole[k] / mass if mass > 0.0 else 0.0
    whole[3] = force[3] - com[1] * force[2] + com[2] * force[1]
    whole[4] = force[4] - com[2] * force[0] + com[0] * force[2]
    whole[5] = force[5] - com[0] * force[1] + com[1] * force[0]


@compiled
def place_turn(place: Vector, target: Vector, turn: OutVector) -> None:
    """Write log3(R_target R') (3,) [rad], world axes: what turns a placement into its target.

    By way of the unit quaternion of the largest component (Shepperd, 1978), which is exact for
    small turns and for turns of nearly pi.

    Args:
        place, target: rotation, column by column, and translation (12,).
        turn: result.
    """
    # M = R_target R', both given column by column
    m00 = target[0] * place[0] + target[3] * place[3] + target[6] * place[6]
    m01 = target[0] * place[1] + target[3] * place[4] + target[6] * place[7]
    m02 = target[0] * place[2] + target[3] * place[5] + target[6] * place[8]
    m10 = target[1] * place[0] + target[4] * place[3] + target[7] * place[6]
    m11 = target[1] * place[1] + target[4] * place[4] + target[7] * place[7]
    m12 = target[1] * place[2] + target[4] * place[5] + target[7] * place[8]
    m20 = target[2] * place[0] + target[5] * place[3] + target[8] * place[6]
    m21 = target[2] * place[1] + target[5] * place[4] + target[8] * place[7]
    m22 = target[2] * place[2] + target[5] * place[5] + target[8] * place[8]
    trace = m00 + m11 + m22
    if trace >= m00 and trace >= m11 and trace >= m22:
        w, x, y, z = 1.0 + trace, m21 - m12, m02 - m20, m10 - m01
    elif m00 >= m11 and m00 >= m22:
        w, x, y, z = m21 - m12, 1.0 + 2.0 * m00 - trace, m01 + m10, m02 + m20
    elif m11 >= m22:
        w, x, y, z = m02 - m20, m01 + m10, 1.0 + 2.0 * m11 - trace, m12 + m21
    else:
        w, x, y, z = m10 - m01, m02 + m20, m12 + m21, 1.0 + 2.0 * m22 - trace
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine <= 1e-9 * w else 2.0 * atan2(sine, w) / sine
    turn[0], turn[1], turn[2] = scale * x, scale * y, scale * z


@compiled
def place_missing(
    rows: RowsMemory, e: int, target: Vector, rates: Vector, missing: OutVector
) -> None:
    """Write what the present state misses of the target of an entry; call after its rows.

    Args:
        rows: ROWS.
        e: number of the entry.
        target: as a placement (12,), of a momentum the momentum in front.
        rates: J v of all rows (k,); a momentum is a rate itself.
        missing: result (k,), of the rows of this entry.
    """
    plan, place, turn = rows.plan, rows.places[e], np.empty(3)
    row, begin, width, step = plan[e, 2], plan[e, 3], plan[e, 4], plan[e, 5]
    if plan[e, 0] != MOMENTUM and begin + (width - 1) * step >= 3:
        place_turn(place, target, turn)
    for k in range(width):
        a = begin + k * step
        if plan[e, 0] == MOMENTUM:
            missing[row + k] = target[a] - rates[row + k]
        else:
            missing[row + k] = target[9 + a] - place[9 + a] if a < 3 else turn[a - 3]


@compiled
def _turn_back(places: OutDense, number: int, six: OutVector) -> None:
    """Turn a linear and an angular vector (6,) from world axes into those of a placement."""
    for first in range(0, 6, 3):
        x, y, z = six[first], six[first + 1], six[first + 2]
        for a in range(3):
            along, across = places[number, 3 * a] * x, places[number, 3 * a + 1] * y
            six[first + a] = along + across + places[number, 3 * a + 2] * z


@compiled
def _moved(
    rates: Dense, drifts: Dense, joint: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float]:
    """Return velocity, and acceleration at qdd = 0, of a point of a joint's body."""
    wx, wy, wz = rates[joint, 3], rates[joint, 4], rates[joint, 5]
    vx = rates[joint, 0] + wy * z - wz * y
    vy = rates[joint, 1] + wz * x - wx * z
    vz = rates[joint, 2] + wx * y - wy * x
    ax, ay, az = drifts[joint, 3], drifts[joint, 4], drifts[joint, 5]
    bx = drifts[joint, 0] + ay * z - az * y + wy * vz - wz * vy
    by = drifts[joint, 1] + az * x - ax * z + wz * vx - wx * vz
    bz = drifts[joint, 2] + ax * y - ay * x + wx * vy - wy * vx
    return vx, vy, vz, bx, by, bz


@compiled
def place_apart(
    tree: TreeMemory, joint: int, other: int, points: Row, row: OutRow
) -> tuple[float, float, float]:
    """Write n'(J_other - J_one) (nv,) of two points.

    Args:
        tree: a TREE.
        joint, other: that carry the points.
        points: one point, the other, and the direction n from one to the other (9,), world.
        row: result.

    Returns:
        n'(v_other - v_one), the same of their accelerations at qdd = 0, and the square of what of
        v_other - v_one is across n.
    """
    jacobian, starts, columns = tree.jacobian, tree.starts, tree.columns
    nx, ny, nz = points[6], points[7], points[8]
    row[:] = 0.0
    rx, ry, rz, bend = 0.0, 0.0, 0.0, 0.0
    for side in range(2):
        sign = 2.0 * side - 1.0
        at = other if side == 1 else joint
        px, py, pz = points[3 * side], points[3 * side + 1], points[3 * side + 2]
        mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
        for place in range(starts[at], starts[at + 1]):
            j = columns[place]
            along = nx * jacobian[0, j] + ny * jacobian[1, j] + nz * jacobian[2, j]
            along += mx * jacobian[3, j] + my * jacobian[4, j] + mz * jacobian[5, j]
            row[j] += sign * along
        vx, vy, vz, bx, by, bz = _moved(tree.rates, tree.drifts, at, px, py, pz)
        rx, ry, rz = rx + sign * vx, ry + sign * vy, rz + sign * vz
        bend += sign * (nx * bx + ny * by + nz * bz)
    speed = nx * rx + ny * ry + nz * rz
    return speed, bend, rx * rx + ry * ry + rz * rz - speed * speed


@compiled
def place_frame(
    tree: TreeMemory, joint: int, offsets: Dense, entry: int, first: int, places: OutDense, row: int
) -> None:
    """Write the placement (12,) of a frame whose offset (12,) begins at `first` into a row."""
    joints = tree.places
    for a in range(3):
        for c in range(4):
            total = joints[joint, 9 + a] if c == 3 else 0.0
            for b in range(3):
                total += joints[joint, 3 * b + a] * offsets[entry, first + 3 * c + b]
            places[row, 3 * c + a] = total


@compiled
def _place_distance(tree: TreeMemory, rows: RowsMemory, e: int) -> None:
    """Write the row of the distance of two frames; its place holds the distance at 9."""
    plan, places, points = rows.plan, rows.places, np.empty((2, 12))
    place_frame(tree, plan[e, 1], rows.offsets, e, 0, points, 0)
    place_frame(tree, plan[e, 6], rows.offsets, e, 15, points, 1)
    ends, distance = np.empty(9), 0.0
    for a in range(3):
        ends[a], ends[3 + a] = points[0, 9 + a], points[1, 9 + a]
        ends[6 + a] = ends[3 + a] - ends[a]
        distance += ends[6 + a] * ends[6 + a]
    distance = sqrt(distance)
    if distance < NO_DISTANCE:
        distance, ends[6], ends[7], ends[8] = NO_DISTANCE, 0.0, 0.0, NO_DISTANCE
    for a in range(3):
        ends[6 + a] /= distance
    row = plan[e, 2]
    _, bend, across = place_apart(tree, plan[e, 1], plan[e, 6], ends, rows.jacobian[row])
    rows.drift[row], places[e, 9] = bend + across / distance, distance


@compiled
def _place_whole(tree: TreeMemory, rows: RowsMemory, e: int, mass: float) -> None:
    """Write rows of the centre of mass, or those of the momentum where `mass` is one."""
    plan, jacobian, momentum = rows.plan, rows.jacobian, tree.momentum
    row, begin, count, step = plan[e, 2], plan[e, 3], plan[e, 4], plan[e, 5]
    of_mass = plan[e, 0] != MOMENTUM
    for k in range(count):
        a = begin + k * step
        for j in range(jacobian.shape[1]):
            jacobian[row + k, j] = momentum[a, j] / mass
        rows.drift[row + k] = tree.com_drift[a] if of_mass else tree.momentum_drift[a]
    for a in range(3):
        rows.places[e, 9 + a] = tree.com[a] if of_mass else 0.0


@compiled
def fill_state_rows(tree: TreeMemory, rows: RowsMemory, mass: float) -> None:
    """Write the rows of ROWS; call after `move_joints`.

    For a joint of spatial velocity V and drift A at the world's origin and a point p of its body,

        linear  J_lin + J_ang x p,    A_lin + A_ang x p + w x (V_lin + w x p),

    the last term left out in a spatial acceleration. A ball that rolls on its surface point p - u
    has the rows J_lin - J_ang x u, and its centre accelerates by alpha x u: no w x (w x u).

    Args:
        tree, rows: a TREE and ROWS.
        mass: of the robot [kg].
    """
    plan, offsets, used, places = rows.plan, rows.offsets, rows.used, rows.places
    found, drift = rows.jacobian, rows.drift
    jacobian, starts, columns = tree.jacobian, tree.starts, tree.columns
    rates, drifts = tree.rates, tree.drifts
    six = np.empty(6)
    for e in range(len(plan)):
        if used[e] == 0:
            continue
        kind, joint, row = plan[e, 0], plan[e, 1], plan[e, 2]
        begin, count, step = plan[e, 3], plan[e, 4], plan[e, 5]
        if kind in (CENTER_OF_MASS, MOMENTUM, BALANCE):
            _place_whole(tree, rows, e, 1.0 if kind == MOMENTUM else mass)
            continue
        if kind == DISTANCE:
            _place_distance(tree, rows, e)
            continue
        place_frame(tree, joint, offsets, e, 0, places, e)
        px, py, pz = places[e, 9], places[e, 10], places[e, 11]
        ux, uy, uz = offsets[e, 12], offsets[e, 13], offsets[e, 14]
        qx, qy, qz = px - ux, py - uy, pz - uz
        for place in range(starts[joint], starts[joint + 1]):
            j = columns[place]
            wx, wy, wz = jacobian[3, j], jacobian[4, j], jacobian[5, j]
            six[0] = jacobian[0, j] + wy * qz - wz * qy
            six[1] = jacobian[1, j] + wz * qx - wx * qz
            six[2] = jacobian[2, j] + wx * qy - wy * qx
            six[3], six[4], six[5] = wx, wy, wz
            if kind == OWN:
                _turn_back(places, e, six)
            for k in range(count):
                found[row + k, j] = six[begin + k * step]
        wx, wy, wz = drifts[joint, 3], drifts[joint, 4], drifts[joint, 5]
        six[3], six[4], six[5] = wx, wy, wz
        if kind == OWN:
            six[0] = drifts[joint, 0] + wy * pz - wz * py
            six[1] = drifts[joint, 1] + wz * px - wx * pz
            six[2] = drifts[joint, 2] + wx * py - wy * px
            _turn_back(places, e, six)
        else:
            _, _, _, ax, ay, az = _moved(rates, drifts, joint, px, py, pz)
            six[0] = ax - wy * uz + wz * uy
            six[1] = ay - wz * ux + wx * uz
            six[2] = az - wx * uy + wy * ux
        for k in range(count):
            drift[row + k] = six[begin + k * step]


@compiled
def place_distances(
    tree: TreeMemory,
    joints: Table,
    points: Dense,
    distances: Row,
    numbers: Row,
    rows: OutDense,
    least: OutRow,
) -> None:
    """Write the rows of `CollisionLimit`, rows qdd >= least.

    Args:
        tree: a TREE.
        joints: joint of either side (p, 2).
        points: nearest points of both sides and the direction between them (p, 9), world.
        distances: (p,) [m].
        numbers: margin, rate and influence of the limit.
        rows, least: results (p, nv), (p,).
    """
    margin, rate, influence = numbers[0], numbers[1], numbers[2]
    for i in range(len(distances)):
        rows[i, :], least[i] = 0.0, -1e20
        if distances[i] < influence:
            speed, bend, _ = place_apart(tree, joints[i, 0], joints[i, 1], points[i], rows[i])
            least[i] = -bend - 2.0 * rate * speed - rate * rate * (distances[i] - margin)
