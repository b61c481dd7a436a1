"""Balancing on one point: the centre of mass is moved to steer angular momentum and pitch."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, sqrt
from typing import ClassVar, final

import numpy as np

from wbc.arrays import require_ranges
from wbc.compiled import Dense, OutDense, Row, compiled, local
from wbc.control.kinematics import Kinematics, RowKind, RowsMemory, StateRows, TreeMemory
from wbc.control.qp.linalg import factorise_from, substitute
from wbc.control.rows.tasks import Gains, StateTask, Task
from wbc.errors import ControlError
from wbc.mechanics.kinematics import placed_at, product
from wbc.mechanics.linear import dot

_FOOT_X, _FOOT_Z, _COM_X, _COM_Z, _SPIN, _PITCH = range(6)


@compiled
def place_rows(
    tree: TreeMemory,
    foot: int,
    frame: int,
    foot_x: float,
    foot_z: float,
    mass: float,
    rows: OutDense,
) -> None:
    """Write what the feedback reads of each unit of v (6, nv).

    The rows are x and z of the foot, x and z of the centre of mass, the angular momentum about +y,
    and the pitch of the frame.

    Args:
        tree: a TREE.
        foot, frame: joints that carry the foot, and the frame whose pitch is kept.
        foot_x, foot_z: where the foot is [m].
        mass: [kg].
        rows: result.
    """
    motions, momentum, starts, columns = tree.motions, tree.momentum, tree.starts, tree.columns
    for j in range(rows.shape[1]):
        rows[_FOOT_X, j], rows[_FOOT_Z, j], rows[_PITCH, j] = 0.0, 0.0, 0.0
        rows[_COM_X, j], rows[_COM_Z, j] = momentum[0, j] / mass, momentum[2, j] / mass
        rows[_SPIN, j] = momentum[4, j]
    for place in range(starts[foot], starts[foot + 1]):
        j = columns[place]
        rows[_FOOT_X, j] = motions[j, 0] + motions[j, 4] * foot_z
        rows[_FOOT_Z, j] = motions[j, 2] - motions[j, 4] * foot_x
    for place in range(starts[frame], starts[frame + 1]):
        rows[_PITCH, columns[place]] = motions[columns[place], 4]


@compiled
def pitch_rate(rows: Dense) -> tuple[float, float]:
    """Return a and c of dtheta/dt = a xd + c k for the smallest motion with a resting foot.

    Both are NaN where the foot cannot rest.

    Args:
        rows: as `place_rows` writes them (6, nv).
    """
    normal, weights = np.empty((5, 5)), np.empty(5)
    for i in range(5):
        weights[i] = dot(rows[i], rows[_PITCH])
        for k in range(i + 1):
            normal[i, k] = dot(rows[i], rows[k])
        normal[i, i] += 1e-12
    if not factorise_from(normal, 0, 5):
        return np.nan, np.nan
    substitute(normal, 5, weights)
    return weights[_COM_X], weights[_SPIN]


@compiled
def balancing(
    tree: TreeMemory, entries: RowsMemory, e: int, velocity: Row, mass: float, target: float
) -> float:
    """Return xdd [m/s^2], the feedback on (x, xd, k, theta) with all poles at -p.

    With u = xdd, G = m g and Z = m z the loop's polynomial is

        s^4 + (k2 - Z k3) s^3 + (k1 + (a - c Z) k4) s^2 + G k3 s + c G k4 = (s + p)^4.

    Args:
        tree: a TREE.
        entries: ROWS, of which row e names the foot, the frame whose pitch is kept, and p [1/s] in
            place of an arm, or 0 for that of the pendulum's fall, sqrt(g/z).
        e: number of the entry.
        velocity: v (nv,).
        mass: m [kg].
        target: theta wanted [rad].
    """
    foot, frame, com, offset = entries.plan[e, 1], entries.plan[e, 6], tree.com, entries.offsets[e]
    at, turn, weight = local(3), local(9), mass * sqrt(dot(tree.gravity, tree.gravity))
    placed_at(tree.poses[foot], offset[9:12], at)
    product(tree.poses[frame], offset[15:24], turn)
    x, z = at[0], at[2]
    rows = np.empty((6, len(velocity)))
    place_rows(tree, foot, frame, x, z, mass, rows)
    from_speed, from_momentum = pitch_rate(rows)
    place, height = com[0] - x, com[2] - z
    speed, spin = dot(rows[_COM_X], velocity), dot(rows[_SPIN], velocity)
    pole = offset[12] if offset[12] > 0.0 else sqrt(weight / mass / abs(height))
    square = pole * pole
    on_pitch = square * square / (from_momentum * weight)
    on_spin = 4.0 * square * pole / weight
    on_speed = 4.0 * pole + mass * height * on_spin
    on_place = 6.0 * square - (from_speed - from_momentum * mass * height) * on_pitch
    pitch = target - atan2(turn[2], turn[8])
    return float(on_pitch * pitch - on_place * place - on_speed * speed - on_spin * spin)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointFootBalanceTask(StateTask):
    """Horizontal acceleration of the centre of mass that keeps a robot up on a point foot.

    On a point no torque holds the robot: with x the horizontal distance of the centre of mass
    from the point, z its height, k the angular momentum about the centre of mass (+y) and theta
    the pitch of a frame,

        dk/dt = m (g x - z xdd),    dtheta/dt = a xd + c k

    (a, c from the Jacobians of contact, centre of mass and momentum). The task's one row is xdd;
    it wants the state feedback that puts the four poles of (x, xd, k, theta) at -bandwidth, so
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
    kind: ClassVar[RowKind] = RowKind.BALANCE
    own_rows: ClassVar[slice] = slice(0, 1)

    def __post_init__(self) -> None:
        """Check the bandwidth."""
        super().__post_init__()
        require_ranges(self, f"task '{self.name}': ", ControlError, bandwidth="> 0 1/s")

    @property
    def state_rows(self) -> StateRows:
        """The row of the centre of mass, and what its feedback reads."""
        pole = (self.bandwidth or 0.0, 0.0, 0.0)
        return StateRows(self.kind, self.contact, self.rows(), pole, self.frame)

    def value(self, kinematics: Kinematics) -> float:
        """Return the pitch theta [rad], the rotation of the frame about +y."""
        rotation = kinematics.placement(kinematics.frame_id(self.frame)).rotation
        return atan2(rotation.item(0, 2), rotation.item(2, 2))

    error = Task.error

    def gains(self, gravity: float) -> Gains:
        """Return one for the feedback, which the tick writes in place of the error."""
        return Gains(1.0, 0.0, 0.0, 1.0)
