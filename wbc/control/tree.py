"""Motion of all joints of a tree, and rows of frames, momentum and distances on it, compiled."""

from __future__ import annotations

from enum import IntEnum
from math import atan2, sqrt
from typing import Annotated, Any

from wbc.compiled import (
    Dense,
    Matrix,
    OutDense,
    OutFlags,
    OutRow,
    Places,
    Row,
    Table,
    Vector,
    compiled,
    inner,
    local,
    view,
)
from wbc.mechanics.inertia import bodies_at, move_bodies
from wbc.mechanics.kinematics import placed_at, product
from wbc.mechanics.linear import add_cross, add_times, apart, copy_to, dot
from wbc.structures import Structure

TREE = Structure(
    "Tree",
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

momentum A_g (6, nv), places (j, 12) of joints, rotation column by column before translation,
motions (nv, 6) = J', mass_matrix (nv, nv) and com (3,) are pinocchio's own memory. joints and
shapes are those of a `Tree` (`wbc.mechanics.kinematics`), without axes and placements, behind a
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
    places=(OutDense, "e", 12),
    jacobian=(OutDense, "k", "v"),
    drift=(OutRow, "k"),
)
"""Rows of entries e: J (k, nv) and dJ/dt v (k,).

plan (e, 7): kind, joint, first row, first component, their number and step, the other joint;
offsets (e, 27): rotation and origin in the joint's frame, the arm of a rolling ball, rotation and
origin of the other frame; used (e,): 0 where nothing is to be written; places (e, 12): result.
Here and in poses (j, 12) rotations stand row by row.
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
    for i in range(len(places)):
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


@compiled(counted=False)
def place_turn(place: Row, target: Row, turn: OutRow) -> None:
    """Write log3(R_target R') (3,) [rad], world axes: what turns a placement into its target.

    By way of the unit quaternion of the largest component (Shepperd, 1978), which is exact for
    small turns and for turns of nearly pi.

    Args:
        place, target: rotation, row by row, and translation (12,).
        turn: result.
    """
    matrix, i = view(local(9), 0, 3, 3), 0
    for a in range(3):
        for b in range(3):
            matrix[a, b] = dot(target[3 * a : 3 * a + 3], place[3 * b : 3 * b + 3])
        i = a if matrix[a, a] > matrix[i, i] else i
    j, k, trace = (i + 1) % 3, (i + 2) % 3, matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    if trace >= matrix[i, i]:
        w, turn[0] = 1.0 + trace, matrix[2, 1] - matrix[1, 2]
        turn[1], turn[2] = matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]
    else:
        w, turn[i] = matrix[k, j] - matrix[j, k], 1.0 + 2.0 * matrix[i, i] - trace
        turn[j], turn[k] = matrix[i, j] + matrix[j, i], matrix[i, k] + matrix[k, i]
    sine, sign = sqrt(dot(turn, turn)), 1.0 if w >= 0.0 else -1.0
    scale = 2.0 / abs(w) if sine <= 1e-9 * abs(w) else 2.0 * atan2(sine, abs(w)) / sine
    for a in range(3):
        turn[a] *= sign * scale


@compiled(counted=False)
def place_missing(rows: RowsMemory, e: int, target: Row, rates: Row, missing: OutRow) -> None:
    """Write what the present state misses of the target of an entry; call after its rows.

    Args:
        rows: ROWS.
        e: number of the entry.
        target: as a placement (12,), of a momentum the momentum in front.
        rates: J v of all rows (k,); a momentum is a rate itself.
        missing: result (k,), of the rows of this entry.
    """
    plan, place, turn = rows.plan, rows.places[e], local(3)
    row, begin, width, step = plan[e, 2], plan[e, 3], plan[e, 4], plan[e, 5]
    if plan[e, 0] != MOMENTUM and begin + (width - 1) * step >= 3:
        place_turn(place, target, turn)
    for k in range(width):
        a = begin + k * step
        if plan[e, 0] == MOMENTUM:
            missing[row + k] = target[a] - rates[row + k]
        else:
            missing[row + k] = target[9 + a] - place[9 + a] if a < 3 else turn[a - 3]


@inner
def _turn_back(place: Row, six: OutRow) -> None:
    """Turn a linear and an angular vector (6,) from world axes into those of a placement."""
    for first in range(0, 6, 3):
        x, y, z = six[first], six[first + 1], six[first + 2]
        for a in range(3):
            six[first + a] = place[a] * x + place[3 + a] * y + place[6 + a] * z


@inner
def _move(tree: TreeMemory, joint: int, point: Row, velocity: OutRow, drift: OutRow) -> None:
    """Write v and, at qdd = 0, its rate (3,) of a point of a joint's body, world axes."""
    rates, drifts = tree.rates[joint], tree.drifts[joint]
    copy_to(rates[:3], velocity)
    copy_to(drifts[:3], drift)
    add_cross(1.0, rates[3:], point, velocity)
    add_cross(1.0, drifts[3:], point, drift)
    add_cross(1.0, rates[3:], velocity, drift)


@inner
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
    normal, pull, rate, velocity, drift = points[6:], local(6), local(3), local(3), local(3)
    row[:], rate[:], bend = 0.0, 0.0, 0.0
    copy_to(normal, pull)
    for side in range(2):
        sign, at, point = 2.0 * side - 1.0, other if side == 1 else joint, points[3 * side :]
        pull[3:] = 0.0
        add_cross(1.0, point, normal, pull[3:])
        for place in range(tree.starts[at], tree.starts[at + 1]):
            column = tree.columns[place]
            row[column] += sign * dot(pull, tree.motions[column])
        _move(tree, at, point, velocity, drift)
        add_times(sign, velocity, rate)
        bend += sign * dot(normal, drift)
    speed = dot(normal, rate)
    return speed, bend, dot(rate, rate) - speed * speed


@inner
def _place_distance(tree: TreeMemory, rows: RowsMemory, e: int) -> None:
    """Write the row of the distance of two frames; its place holds the distance at 9."""
    plan, offsets, ends, row = rows.plan, rows.offsets, local(9), rows.plan[e, 2]
    placed_at(tree.poses[plan[e, 1]], offsets[e, 9:12], ends[:3])
    placed_at(tree.poses[plan[e, 6]], offsets[e, 24:], ends[3:6])
    distance = sqrt(apart(ends[:3], ends[3:6]))
    for a in range(3):
        ends[6 + a] = (ends[3 + a] - ends[a]) / max(distance, NO_DISTANCE)
    if distance < NO_DISTANCE:
        distance, ends[6], ends[7], ends[8] = NO_DISTANCE, 0.0, 0.0, 1.0
    _, bend, across = place_apart(tree, plan[e, 1], plan[e, 6], ends, rows.jacobian[row])
    rows.drift[row], rows.places[e, 9] = bend + across / distance, distance


@inner
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


@compiled(counted=False)
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
    plan, offsets, jacobian, drift = rows.plan, rows.offsets, rows.jacobian, rows.drift
    six, touches, velocity = local(6), local(3), local(3)
    for e in range(len(plan)):
        if rows.used[e] == 0:
            continue
        kind, joint, row, place = plan[e, 0], plan[e, 1], plan[e, 2], rows.places[e]
        begin, count, step = plan[e, 3], plan[e, 4], plan[e, 5]
        if kind in (CENTER_OF_MASS, MOMENTUM, BALANCE):
            _place_whole(tree, rows, e, 1.0 if kind == MOMENTUM else mass)
            continue
        if kind == DISTANCE:
            _place_distance(tree, rows, e)
            continue
        product(tree.poses[joint], offsets[e], place)
        placed_at(tree.poses[joint], offsets[e, 9:], place[9:])
        for a in range(3):
            touches[a] = place[9 + a] - offsets[e, 12 + a]
        for at in range(tree.starts[joint], tree.starts[joint + 1]):
            column = tree.columns[at]
            copy_to(tree.motions[column], six)
            add_cross(1.0, tree.motions[column, 3:], touches, six)
            if kind == OWN:
                _turn_back(place, six)
            for k in range(count):
                jacobian[row + k, column] = six[begin + k * step]
        copy_to(tree.drifts[joint], six)
        if kind == OWN:
            add_cross(1.0, tree.drifts[joint, 3:], place[9:], six)
            _turn_back(place, six)
        else:
            _move(tree, joint, place[9:], velocity, six)
            add_cross(-1.0, six[3:], offsets[e, 12:], six)
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
