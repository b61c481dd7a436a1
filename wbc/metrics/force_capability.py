"""Asymmetric force capability: what a leg can lift, and what it can hold.

Sim & Ramos, section IV.B.2: J_m^-T B E_m convhull(tau_phi). The statics read backwards need no
inverse: a force f on the point asks gear torques T = D' J_m' f, and each gear passes at most
eta_f U (lifting) or U/eta_b (holding) of its motor's U = N tau_max. At rest both are ends of one
interval (slip 7 in docs/physics.md). The weight of the links is not counted, as in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection

from wbc.arrays import FloatArray, frozen
from wbc.errors import DynamicsError
from wbc.metrics.contact_task import ContactTask, contact_task
from wbc.robot import Robot
from wbc.transmission import Direction

_NOTHING = 1e-9


@dataclass(frozen=True)
class ForceRange:
    """The largest force along one direction [N].

    Attributes:
        conventional: with perfect gears.
        lift: that the motors can raise, all gears forward.
        hold: that the motors can resist, all gears backward; infinite where a gear locks itself.
    """

    conventional: float
    lift: float
    hold: float


@dataclass(frozen=True, eq=False)
class ForceCapability:
    """The polytope of forces {f : |T_from_f f| <= limits} at one contact point.

    Attributes:
        task: the contact point and pose.
        gears: rows of the transmission that a force on the point loads at all.
        torque_from_force: D' J_m' (k, n) [m] of those gears.
    """

    task: ContactTask
    gears: tuple[int, ...]
    torque_from_force: FloatArray

    def limits(self, directions: ArrayLike) -> FloatArray:
        """Return the largest gear torque |T| (k,) [N m] at the motor output.

        Rotor Coulomb friction takes its part of the motor's torque when lifting and adds it when
        holding.

        Args:
            directions: per gear of the robot (m,) or one for all: +1 lift, -1 hold, 0 without
                losses.
        """
        gears = self.task.robot.transmission
        mode = np.broadcast_to(np.asarray(directions, dtype=np.float64), (gears.size,))
        friction = np.where(mode == 0.0, 0.0, gears.rotor_coulomb_friction)
        reach = np.maximum(gears.torque_limit - np.sign(mode) * friction, 0.0)
        motor = np.abs(gears.gear_ratio) * reach
        safe = np.where(gears.self_locking, 1.0, gears.backward_efficiency)
        held = np.where(gears.self_locking, np.inf, motor / safe)
        limit = np.where(
            mode > 0, gears.forward_efficiency * motor, np.where(mode < 0, held, motor)
        )
        return np.asarray(limit[list(self.gears)])

    def along(self, direction: ArrayLike) -> ForceRange:
        """Return the largest force along `direction` (n,), no force across it.

        Raises:
            DynamicsError: a direction in which the structure carries the force without any
                torque (a singular pose).
        """
        n = self.task.direction(direction)
        torque = np.abs(self.torque_from_force @ n)
        if not torque.size or torque.max() <= _NOTHING * self._scale():
            raise self._unbounded(n)
        loaded = torque > _NOTHING * self._scale()
        modes = (Direction.STUCK, Direction.FORWARD, Direction.BACKWARD)
        ends = [float(np.min(self.limits(mode)[loaded] / torque[loaded])) for mode in modes]
        return ForceRange(*ends)

    def furthest(self, direction: ArrayLike, directions: ArrayLike) -> FloatArray:
        """Return the force (n,) [N] that reaches furthest along `direction`, free across it.

        In closed form where D'J_m' is square, by a linear program otherwise.

        Args:
            direction: (n,) along the task's axes.
            directions: +1 lift, -1 hold, 0 without losses, per gear or one for all.

        Raises:
            DynamicsError: a singular pose, or a gear without torque limit: no force is largest.
        """
        n = self.task.direction(direction)
        limits = self._bounded(directions)
        matrix = self.torque_from_force
        if matrix.shape[0] == matrix.shape[1]:
            return np.asarray(
                np.linalg.solve(matrix, limits * np.sign(np.linalg.solve(matrix.T, n)))
            )
        result = linprog(
            -n,
            A_ub=np.vstack([matrix, -matrix]),
            b_ub=np.concatenate([limits, limits]),
            bounds=(None, None),
            method="highs",
        )
        if not result.success:
            raise DynamicsError(f"the linear program of the force capability: {result.message}")
        return np.asarray(result.x)

    def vertices(self, directions: ArrayLike) -> FloatArray:
        """Return the corners (c, n) [N] of the polytope, convex-hull vertices in no order.

        Args:
            directions: +1 lift, -1 hold, 0 without losses, per gear or one for all.

        Raises:
            DynamicsError: a singular pose, or a gear without torque limit: no finite corners.
        """
        limits = self._bounded(directions)
        matrix = self.torque_from_force
        if matrix.shape[0] == matrix.shape[1]:
            corners = np.array(list(product((-1.0, 1.0), repeat=len(limits)))) * limits
            return np.asarray(np.linalg.solve(matrix, corners.T).T)
        if matrix.shape[1] == 1:
            end = 1.0 / float(np.max(np.abs(matrix[:, 0]) / limits))
            return np.array([[-end], [end]])
        half = np.column_stack([np.vstack([matrix, -matrix]), -np.tile(limits, 2)])
        corners = HalfspaceIntersection(half, np.zeros(matrix.shape[1])).intersections
        # Corners where several faces meet come out once per set of faces.
        size = float(np.abs(corners).max())
        return np.asarray(size * np.unique(np.round(corners / size, 9), axis=0))

    def _bounded(self, directions: ArrayLike) -> FloatArray:
        limits = self.limits(directions)
        sizes = np.linalg.svd(self.torque_from_force)[1:]
        values = np.zeros(len(self.task.axes))
        values[: len(sizes[0])] = sizes[0]
        if values[-1] <= _NOTHING * self._scale():
            raise self._unbounded(sizes[1][-1])
        if not np.isfinite(limits).all() or not np.all(limits > 0.0):
            joints = self.task.robot.transmission.joints
            open_ended = [
                joints[g]
                for g, limit in zip(self.gears, limits, strict=True)
                if not 0.0 < limit < np.inf
            ]
            raise DynamicsError(
                f"the gears of {', '.join(open_ended)} hold any torque or none (no torque_limit, "
                "a self-locking gear, or friction above the limit): the force capability has no "
                "finite corners. Use along() instead."
            )
        return limits

    def _scale(self) -> float:
        return float(np.abs(self.torque_from_force).max(initial=_NOTHING))

    def _unbounded(self, direction: FloatArray) -> DynamicsError:
        along = ", ".join(f"{x:.3g}" for x in direction)
        return DynamicsError(
            f"a force on '{self.task.contact}' along [{along}] (axes {self.task.axes}) loads no "
            "motor in this pose: no torque limits it. Leave the singular pose, or choose the "
            "axes that the leg's motors act on (for example axes='xz')."
        )


def force_capability(
    robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz"
) -> ForceCapability:
    """Return the force capability of the limb that ends in a contact point.

    Args:
        robot: fixed or floating base; only the gears that the contact loads count.
        position: q (nq,).
        contact: name of the contact point.
        axes: world axes of the force, for example "xz" for a planar contact.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
    """
    task = contact_task(robot, position, contact, axes)
    torque = robot.transmission.topology.T @ task.jacobian[:, robot.actuated].T
    full = robot.transmission.topology.T @ _contact_rows(task).T
    used = np.flatnonzero(np.abs(full).max(axis=1, initial=0.0) > _NOTHING)
    return ForceCapability(task, tuple(used.tolist()), frozen(torque[used]))


def _contact_rows(task: ContactTask) -> FloatArray:
    """Return all three rows of the limb's Jacobian, so that a gear counts even in one bad pose."""
    start = 3 * [point.name for point in task.robot.contacts].index(task.contact)
    return task.terms.contact_jacobian[start : start + 3][:, task.robot.actuated]
