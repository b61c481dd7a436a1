"""Balancing on one point: the centre of mass is moved to steer angular momentum and pitch."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, sqrt
from typing import final

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.control.compiled import Matrix, Number, compiled
from wbc.control.kinematics import Kinematics
from wbc.control.positive_definite import factorise, substitute
from wbc.control.reference import Reference, Target
from wbc.control.tasks.frames import require_frame
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
        foot = kinematics.placement(kinematics.frame_id(self.contact)).translation
        com = kinematics.center_of_mass()
        momentum = kinematics.momentum_matrix()[4].dot(kinematics.velocity)
        on_place, on_speed, on_momentum, on_pitch = self.gains(
            kinematics, com.item(2) - foot.item(2)
        )
        wanted = -on_place * (com.item(0) - foot.item(0)) - on_speed * rate.item(0)
        wanted -= on_momentum * float(momentum)
        pitch: Target = reference.position
        wanted += on_pitch * (float(pitch) - self.value(kinematics))
        if reference.acceleration is not None:
            wanted += float(reference.acceleration[0])
        return np.array([wanted])

    def gains(self, kinematics: Kinematics, height: float) -> tuple[float, float, float, float]:
        """Return the feedback on (x, xd, k, theta) with all poles at -p, p the bandwidth.

        With u = xdd, G = m g and Z = m z the loop's polynomial is

            s^4 + (k2 - Z k3) s^3 + (k1 + (a - c Z) k4) s^2 + G k3 s + c G k4 = (s + p)^4.

        Args:
            kinematics: of the present state.
            height: z of the centre of mass above the foot [m], not zero.
        """
        mass = kinematics.mass
        gravity = kinematics.gravity
        from_speed, from_momentum = self._pitch_rate(kinematics)
        pole = sqrt(gravity / abs(height)) if self.bandwidth is None else self.bandwidth
        on_pitch = pole**4 / (from_momentum * mass * gravity)
        on_momentum = 4.0 * pole**3 / (mass * gravity)
        on_speed = 4.0 * pole + mass * height * on_momentum
        on_place = 6.0 * pole**2 - (from_speed - from_momentum * mass * height) * on_pitch
        return on_place, on_speed, on_momentum, on_pitch

    def _pitch_rate(self, kinematics: Kinematics) -> tuple[float, float]:
        """Return a and c of dtheta/dt = a xd + c k for the smallest motion with a resting foot."""
        found: tuple[float, float] = pitch_rate(
            kinematics.frame_jacobian(kinematics.frame_id(self.contact)),
            kinematics.center_of_mass_jacobian(),
            kinematics.momentum_matrix(),
            kinematics.frame_jacobian(kinematics.frame_id(self.frame)),
        )
        return found


@compiled(types.UniTuple(Number, 2), *[Matrix] * 4)
def pitch_rate(
    foot: FloatArray, com: FloatArray, momentum: FloatArray, frame: FloatArray
) -> tuple[float, float]:
    """Return the weights of xd and k in the pitch rate that fits the other rows best.

    Args:
        foot, frame: Jacobians (6, nv) of the foot, whose x and z rest, and of the frame.
        com, momentum: Jacobian (3, nv) of the centre of mass, of which x and z count, and the
            momentum matrix (6, nv), of which the pitch row counts.
    """
    nv = foot.shape[1]
    rows, normal, weights = np.empty((5, nv)), np.empty((5, 5)), np.empty(5)
    for j in range(nv):
        rows[0, j], rows[1, j] = foot[0, j], foot[2, j]
        rows[2, j], rows[3, j] = com[0, j], com[2, j]
        rows[4, j] = momentum[4, j]
    for i in range(5):
        weights[i] = 0.0
        for j in range(nv):
            weights[i] += rows[i, j] * frame[4, j]
        for k in range(i + 1):
            normal[i, k] = 0.0
            for j in range(nv):
                normal[i, k] += rows[i, j] * rows[k, j]
        normal[i, i] += 1e-12
    if not factorise(normal, 5):
        return np.nan, np.nan
    substitute(normal, 5, weights)
    return weights[2], weights[4]
