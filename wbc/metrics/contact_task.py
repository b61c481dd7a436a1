"""The contact point that a metric speaks of: its Jacobian along the axes asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked
from wbc.dynamics import Terms, dissipative_equation, evaluate
from wbc.errors import DynamicsError, RobotError, unknown_name
from wbc.robot import ContactPoint, Robot

_SINGULAR = 1e10


@dataclass(frozen=True, eq=False)
class ContactTask:
    """A contact point of a robot at rest in one pose.

    Attributes:
        robot: the robot.
        terms: its terms at the pose, velocity zero.
        contact: name of the contact point.
        axes: world axes in use, in order, for example "xz".
        jacobian: J (n, nv), velocity of the point along `axes`.
    """

    robot: Robot
    terms: Terms
    contact: str
    axes: str
    jacobian: FloatArray

    def direction(self, direction: ArrayLike) -> FloatArray:
        """Return `direction` (n,) along `axes` as a unit vector.

        Raises:
            DynamicsError: a wrong length, or the zero vector.
        """
        vector = checked(direction, (len(self.axes),), "direction", DynamicsError)
        length = float(np.linalg.norm(vector))
        if length == 0.0:
            raise DynamicsError(f"direction along {self.axes} must not be zero.")
        return vector / length

    def mobility(self, directions: ArrayLike) -> FloatArray:
        """Return J H^-1 J' (n, n) [1/kg], the acceleration of the point per force on it.

        H = K' E_s H_s K for the given directions of power (Sim & Ramos, section IV). A
        self-locking gear that would be driven backward stands still, the limit eta_b -> 0.

        Args:
            directions: (m,) or one for all: +1 forward, -1 backward, 0 without losses.
        """
        return self.jacobian @ self.response(directions, self.jacobian.T)

    def response(self, directions: ArrayLike, forces: FloatArray) -> FloatArray:
        """Return the acceleration (nv, k) that joint-space forces (nv, k) cause from rest."""
        gears = self.robot.transmission
        mode = np.broadcast_to(np.asarray(directions, dtype=np.float64), (gears.size,)).copy()
        locked = (mode < 0.0) & gears.self_locking
        mode[locked] = 0.0
        inertia = dissipative_equation(self.robot, self.terms, mode).inertia
        free = np.eye(self.robot.model.nv)
        if locked.any():
            rows = np.zeros((int(locked.sum()), self.robot.model.nv))
            rows[:, self.robot.actuated] = gears.motor_from_joint[locked]
            free = np.linalg.svd(rows)[2][len(rows) :].T
        if free.shape[1] == 0:
            return np.zeros_like(forces)
        return np.asarray(free @ np.linalg.solve(free.T @ inertia @ free, free.T @ forces))

    def inverted(self, matrix: FloatArray, what: str) -> FloatArray:
        """Return the inverse of `matrix` (n, n), a mobility.

        Raises:
            DynamicsError: a singular pose; the message names the direction that is lost.
        """
        values, vectors = np.linalg.svd(matrix)[1:]
        if values[-1] * _SINGULAR <= values[0] or values[0] == 0.0:
            lost = ", ".join(f"{x:.3g}" for x in vectors[-1])
            raise DynamicsError(
                f"{what} of '{self.contact}' does not exist in this pose: the point cannot be "
                f"moved along [{lost}] (axes {self.axes}). Leave the singular pose, or choose "
                "the axes in which the point moves (for example axes='xz')."
            )
        return np.asarray(np.linalg.inv(matrix))


def contact_task(robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz") -> ContactTask:
    """Return the task of one contact point in one pose.

    Args:
        robot: the robot.
        position: q (nq,).
        contact: name of the contact point.
        axes: some of the world axes "x", "y", "z", each at most once.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
        RobotError: no such contact point.
    """
    if not axes or len(set(axes)) != len(axes):
        raise DynamicsError(f"axes '{axes}': name each of x, y, z at most once, at least one.")
    for axis in axes:
        if axis not in "xyz":
            raise DynamicsError(unknown_name("axis", axis, "xyz"))
    q = checked(position, (robot.model.nq,), "position", DynamicsError)
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    robot.contact(contact)
    start = 3 * [point.name for point in robot.contacts].index(contact)
    rows = [start + "xyz".index(axis) for axis in axes]
    return ContactTask(robot, terms, contact, axes, terms.contact_jacobian[rows])


def with_contact_at(robot: Robot, name: str) -> Robot:
    """Return the robot with a contact called `name`: its own, or the origin of a frame.

    An arm's description names no contacts; its metrics are those of a frame, for example its last
    link or its tool.

    Raises:
        RobotError: neither a contact nor a frame of that name.
    """
    if any(point.name == name for point in robot.contacts):
        return robot
    if not robot.model.existFrame(name):
        known = [point.name for point in robot.contacts]
        known += [frame.name for frame in robot.model.frames]
        raise RobotError(unknown_name(f"contact or frame of '{robot.name}'", name, known))
    point = ContactPoint(name=name, frame=name, offset=np.zeros(3))
    return replace(robot, contacts=(*robot.contacts, point))
