"""Balancing on one point: the centre of mass is moved to steer angular momentum and pitch."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, sqrt
from typing import Any, ClassVar, cast, final

import numpy as np
from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Nothing,
    Number,
    OutDense,
    Places,
    Row,
    Vector,
    compiled,
    group,
)
from wbc.control.kinematics import FixedFrame, Kinematics, RowKind
from wbc.control.qp.linalg import factorise, substitute
from wbc.control.reference import Reference, Target
from wbc.control.rows.task import StateTask, number_target, require_frame
from wbc.control.tree import TREE
from wbc.errors import ControlError
from wbc.robot import Robot

_FOOT_X, _FOOT_Z, _COM_X, _COM_Z, _SPIN, _PITCH = range(6)
_FIXED = group(FixedFrame, Count, Row, Places)


@compiled(types.UniTuple(Number, 3), Dense, Count, Row)
def placed(joints: FloatArray, joint: int, offset: FloatArray) -> tuple[float, float, float]:
    """Return the origin [m] of a frame in the world.

    Args:
        joints: placements (j, 12), rotation column by column before the translation.
        joint, offset: where the frame is fixed, and how (12,).
    """
    x, y, z = offset[9], offset[10], offset[11]
    return (
        joints[joint, 9] + joints[joint, 0] * x + joints[joint, 3] * y + joints[joint, 6] * z,
        joints[joint, 10] + joints[joint, 1] * x + joints[joint, 4] * y + joints[joint, 7] * z,
        joints[joint, 11] + joints[joint, 2] * x + joints[joint, 5] * y + joints[joint, 8] * z,
    )


@compiled(Number, Dense, Count, Row)
def pitch_of(joints: FloatArray, joint: int, offset: FloatArray) -> float:
    """Return the rotation [rad] about +y of a frame; arguments as for `placed`."""
    x, y, z = offset[6], offset[7], offset[8]
    return atan2(
        joints[joint, 0] * x + joints[joint, 3] * y + joints[joint, 6] * z,
        joints[joint, 2] * x + joints[joint, 5] * y + joints[joint, 8] * z,
    )


@compiled(Nothing, TREE.kind, Places, Places, *[Number] * 3, OutDense)
def place_rows(
    tree: Any,
    foot_moves: IntArray,
    frame_moves: IntArray,
    foot_x: float,
    foot_z: float,
    mass: float,
    rows: FloatArray,
) -> None:
    """Write what the feedback reads of each unit of v (6, nv).

    The rows are x and z of the foot, x and z of the centre of mass, the angular momentum about +y,
    and the pitch of the frame.

    Args:
        tree: a TREE.
        foot_moves, frame_moves: columns of J that move foot and frame.
        foot_x, foot_z: where the foot is [m].
        mass: [kg].
        rows: result.
    """
    jacobian, momentum = tree.jacobian, tree.momentum
    for j in range(rows.shape[1]):
        rows[_FOOT_X, j], rows[_FOOT_Z, j], rows[_PITCH, j] = 0.0, 0.0, 0.0
        rows[_COM_X, j], rows[_COM_Z, j] = momentum[0, j] / mass, momentum[2, j] / mass
        rows[_SPIN, j] = momentum[4, j]
    for i in range(len(foot_moves)):
        j = foot_moves[i]
        rows[_FOOT_X, j] = jacobian[0, j] + jacobian[4, j] * foot_z
        rows[_FOOT_Z, j] = jacobian[2, j] - jacobian[4, j] * foot_x
    for i in range(len(frame_moves)):
        rows[_PITCH, frame_moves[i]] = jacobian[4, frame_moves[i]]


@compiled(types.UniTuple(Number, 2), Dense)
def pitch_rate(rows: FloatArray) -> tuple[float, float]:
    """Return a and c of dtheta/dt = a xd + c k for the smallest motion with a resting foot.

    Both are NaN where the foot cannot rest.

    Args:
        rows: as `place_rows` writes them (6, nv).
    """
    normal, weights = np.empty((5, 5)), np.empty(5)
    for i in range(5):
        weights[i] = 0.0
        for j in range(rows.shape[1]):
            weights[i] += rows[i, j] * rows[_PITCH, j]
        for k in range(i + 1):
            normal[i, k] = 0.0
            for j in range(rows.shape[1]):
                normal[i, k] += rows[i, j] * rows[k, j]
        normal[i, i] += 1e-12
    if not factorise(normal, 5):
        return np.nan, np.nan
    substitute(normal, 5, weights)
    return weights[_COM_X], weights[_SPIN]


@compiled(Number, *[_FIXED] * 2, TREE.kind, Vector, *[Number] * 4)
def balancing(
    contact: tuple[int, FloatArray, IntArray],
    held: tuple[int, FloatArray, IntArray],
    tree: Any,
    velocity: FloatArray,
    mass: float,
    gravity: float,
    bandwidth: float,
    target: float,
) -> float:
    """Return xdd [m/s^2], the feedback on (x, xd, k, theta) with all poles at -p.

    With u = xdd, G = m g and Z = m z the loop's polynomial is

        s^4 + (k2 - Z k3) s^3 + (k1 + (a - c Z) k4) s^2 + G k3 s + c G k4 = (s + p)^4.

    Args:
        contact, held: where the foot is fixed, and the frame whose pitch is kept.
        tree: a TREE.
        velocity: v (nv,).
        mass, gravity: m [kg] and g [m/s^2].
        bandwidth: p [1/s], or 0 for that of the pendulum's fall, sqrt(g/z).
        target: theta wanted [rad].
    """
    (foot, foot_offset, foot_moves), (frame, frame_offset, frame_moves) = contact, held
    nv, joints, com = len(velocity), tree.places, tree.com
    x, _, z = placed(joints, foot, foot_offset)
    rows = np.empty((6, nv))
    place_rows(tree, foot_moves, frame_moves, x, z, mass, rows)
    from_speed, from_momentum = pitch_rate(rows)
    place, height = com[0] - x, com[2] - z
    speed, spin = 0.0, 0.0
    for j in range(nv):
        speed += rows[_COM_X, j] * velocity[j]
        spin += rows[_SPIN, j] * velocity[j]
    pole = bandwidth if bandwidth > 0.0 else sqrt(gravity / abs(height))
    square = pole * pole
    on_pitch = square * square / (from_momentum * mass * gravity)
    on_spin = 4.0 * square * pole / (mass * gravity)
    on_speed = 4.0 * pole + mass * height * on_spin
    on_place = 6.0 * square - (from_speed - from_momentum * mass * height) * on_pitch
    pitch = target - pitch_of(joints, frame, frame_offset)
    wanted: float = on_pitch * pitch - on_place * place - on_speed * speed - on_spin * spin
    return wanted


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointFootBalanceTask(StateTask):
    """Horizontal acceleration of the centre of mass that keeps a robot up on a point foot.

    On a point no torque holds the robot: with x the horizontal distance of the centre of mass
    from the point, z its height, k the angular momentum about the centre of mass (+y) and theta
    the pitch of a frame,

        dk/dt = m (g x - z xdd),    dtheta/dt = a xd + c k

    (a, c from the Jacobians of contact, centre of mass and momentum). The task's one row is xdd;
    it commands the state feedback that puts the four poles of (x, xd, k, theta) at -bandwidth, so
    that the robot leans and swings like an acrobat instead of fighting for x and pitch at once.
    Height belongs to another task. The value is theta [rad]; a reference gives the pitch to keep.

    Attributes:
        contact: frame of the point foot.
        frame: frame whose pitch is kept.
        bandwidth: [1/s] of the poles; None takes sqrt(g/z), the falling rate of the pendulum.
    """

    name: str = "balance"
    contact: str
    frame: str
    bandwidth: float | None = None
    kind: ClassVar[RowKind] = RowKind.CENTER_OF_MASS

    def rows(self) -> slice:
        """Return x."""
        return slice(0, 1)

    def check(self, robot: Robot) -> int:
        """Return 1."""
        require_frame(robot, self.frame, self.name)
        require_frame(robot, self.contact, self.name)
        if self.bandwidth is not None and not self.bandwidth > 0.0:
            raise ControlError(f"task '{self.name}': bandwidth must be > 0 1/s.")
        return 1

    def value(self, kinematics: Kinematics) -> float:
        """Return the pitch theta [rad], the rotation of the frame about +y."""
        rotation = kinematics.placement(kinematics.frame_id(self.frame)).rotation
        return atan2(rotation.item(0, 2), rotation.item(2, 2))

    def admitted(self, target: Target, size: int) -> float:
        """Return the pitch [rad] as a number."""
        return number_target(target)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return the pitch that is missing, (1,) [rad]."""
        return np.array([float(target) - self.value(kinematics)])

    def command(self, kinematics: Kinematics, reference: Reference) -> FloatArray:
        """Return xdd, (1,) [m/s^2]: state feedback on (x, xd, k, theta)."""
        wanted = balancing(
            kinematics.fixed_frame(self.contact),
            kinematics.fixed_frame(self.frame),
            kinematics.tree,
            kinematics.velocity,
            kinematics.mass,
            kinematics.gravity,
            self.bandwidth or 0.0,
            float(cast(Any, reference.position)),
        )
        if reference.acceleration is not None:
            wanted += float(reference.acceleration[0])
        return np.array([wanted])

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write nothing: the pitch is fed back by `command`."""
