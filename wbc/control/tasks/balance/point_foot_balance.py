"""Balancing on one point: the centre of mass is moved to steer angular momentum and pitch."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, RowKind, StateRows
from wbc.control.reference import Reference, Target
from wbc.control.tasks.balance.point_foot_feedback import balancing
from wbc.control.tasks.frames.require import require_frame
from wbc.control.tasks.targets import number_target
from wbc.control.tasks.task import Task
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointFootBalanceTask(Task):
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

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the x row of J_com, (1, nv)."""
        return kinematics.center_of_mass_jacobian()[:1]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the x row of dJ_com/dt v, (1,) [m/s^2]."""
        return kinematics.center_of_mass_drift()[:1]

    def command(self, kinematics: Kinematics, reference: Reference, rate: FloatArray) -> FloatArray:
        """Return xdd, (1,) [m/s^2]: state feedback on (x, xd, k, theta)."""
        target: Target = reference.position
        wanted = balancing(
            *kinematics.fixed_frame(self.contact),
            *kinematics.fixed_frame(self.frame),
            kinematics.joint_places,
            kinematics.joint_jacobian,
            kinematics.momentum_matrix(),
            kinematics.center_of_mass(),
            kinematics.velocity,
            kinematics.mass,
            kinematics.gravity,
            self.bandwidth or 0.0,
            float(target),
        )
        if reference.acceleration is not None:
            wanted += float(reference.acceleration[0])
        return np.array([wanted])

    @property
    def state_rows(self) -> StateRows:
        """The x axis of the centre of mass."""
        return StateRows(RowKind.CENTER_OF_MASS, "", slice(0, 1))

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write nothing: the pitch is fed back by `command`."""
