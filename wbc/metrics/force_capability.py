"""Asymmetric force capability: what a leg can lift, and what it can hold.

Sim & Ramos, section IV.B.2: J_m^-T B E_m convhull(tau_phi). The statics read backwards need no
inverse: a force f on the point asks gear torques T = D' J_m' f, and each gear passes at most
eta_f U (lifting) or U/eta_b (holding) of its motor's U = N tau_max. At rest both are ends of one
interval (correction 7 in docs/method/physics.md). Which end counts depends on where the point is
about to move: `moving` gives one polygon in which each gear whose power runs with the motion lifts
and each other one holds. The weight of the links is not counted, as in the paper.
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
        torque = self.levers(direction)
        loaded = torque > 0.0
        modes = (Direction.STUCK, Direction.FORWARD, Direction.BACKWARD)
        ends = [float(np.min(self.limits(mode)[loaded] / torque[loaded])) for mode in modes]
        return ForceRange(*ends)

    def levers(self, direction: ArrayLike) -> FloatArray:
        """Return the gear torque per force along `direction` (k,) [m], 0 where a gear bears none.

        Raises:
            DynamicsError: no gear bears anything (a singular pose).
        """
        n = self.task.direction(direction)
        torque = np.abs(self.torque_from_force @ n)
        loaded = torque > _NOTHING * self._scale()
        if not loaded.any():
            raise self._unbounded(n)
        return np.asarray(np.where(loaded, torque, 0.0))

    def moving(self, direction: ArrayLike) -> FloatArray:
        """Return the corners (c, n) [N] of the combined polygon of lifting and holding.

        The point is about to move along `direction`, and the motors push it with f. A gear whose
        torque does work in that motion lifts and passes at most eta_f U; a gear that is driven by
        it holds and bears up to U/eta_b; a gear that does not turn holds. Along the motion the
        polygon reaches as far as the leg can lift, against it as far as the leg can hold.

        Args:
            direction: (n,) along the task's axes, in which the point moves; of the motions that
                the gears allow, the one of least kinetic energy is meant.

        Raises:
            DynamicsError: a singular pose, or a gear that holds any torque: no finite corners.
        """
        low, high = self.interval(direction)
        self._require_regular()
        self._require_finite(np.minimum(-low, high))
        return self._corners(low, high)

    def interval(self, direction: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return least and greatest gear torque (k,), (k,) [N m] of a motion; see `moving`."""
        n = self.task.direction(direction)
        robot, perfect = self.task.robot, Direction.STUCK
        moved = self.task.response(perfect, self.task.jacobian.T)
        give = self.task.jacobian @ moved
        path = moved @ np.linalg.lstsq(give, n, rcond=None)[0]
        turning = (robot.transmission.motor_from_joint @ path[robot.actuated])[list(self.gears)]
        turning[np.abs(turning) <= _NOTHING * np.abs(turning).max(initial=0.0)] = 0.0
        lift, hold = self.limits(Direction.FORWARD), self.limits(Direction.BACKWARD)
        high = np.where(turning > 0.0, lift, hold)
        low = np.where(turning < 0.0, -lift, -hold)
        return low, high

    def furthest(self, direction: ArrayLike, directions: ArrayLike) -> FloatArray:
        """Return the force (n,) [N] that reaches furthest along `direction`, free across it.

        In closed form where D'J_m' is square and regular, by a linear program otherwise. In a
        singular pose a direction in which motors do bound the force keeps its answer.

        Args:
            direction: (n,) along the task's axes.
            directions: +1 lift, -1 hold, 0 without losses, per gear or one for all.

        Raises:
            DynamicsError: no motor bounds the force (a singular pose, a gear without torque
                limit).
        """
        n = self.task.direction(direction)
        limits, matrix = self.limits(directions), self.torque_from_force
        if matrix.shape[0] == matrix.shape[1] and self._lost() is None:
            self._require_finite(limits)
            return np.asarray(
                np.linalg.solve(matrix, limits * np.sign(np.linalg.solve(matrix.T, n)))
            )
        bounded = np.isfinite(limits)
        result = linprog(
            -n,
            A_ub=np.vstack([matrix[bounded], -matrix[bounded]]),
            b_ub=np.concatenate([limits[bounded], limits[bounded]]),
            bounds=(None, None),
            method="highs",
        )
        if result.status in (2, 3, 4):  # infeasible never; unbounded, or told apart by presolve
            lost = self._lost()
            if lost is not None:
                raise self._unbounded(lost)
            self._require_finite(limits)
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
        limits = self.limits(directions)
        self._require_regular()
        self._require_finite(limits)
        return self._corners(-limits, limits)

    def _corners(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return the corners (c, n) of {f : low <= T_from_f f <= high}, 0 inside."""
        matrix = self.torque_from_force
        if matrix.shape[0] == matrix.shape[1]:
            corners = np.array(list(product(*zip(low, high, strict=True))))
            return np.asarray(np.linalg.solve(matrix, corners.T).T)
        if matrix.shape[1] == 1:
            lever = matrix[:, 0]
            ends = np.where(lever > 0.0, [low, high], [high, low])[:, lever != 0.0]
            below, above = ends / lever[lever != 0.0]
            return np.array([[below.max()], [above.min()]])
        half = np.column_stack([np.vstack([matrix, -matrix]), np.concatenate([-high, low])])
        corners = HalfspaceIntersection(half, np.zeros(matrix.shape[1])).intersections
        # Corners where several faces meet come out once per set of faces.
        size = float(np.abs(corners).max())
        return np.asarray(size * np.unique(np.round(corners / size, 9), axis=0))

    def _lost(self) -> FloatArray | None:
        """Return a direction (n,) in which no gear bears a force, None in a regular pose."""
        sizes = np.linalg.svd(self.torque_from_force)[1:]
        values = np.zeros(len(self.task.axes))
        values[: len(sizes[0])] = sizes[0]
        return sizes[1][-1] if values[-1] <= _NOTHING * self._scale() else None

    def _require_regular(self) -> None:
        lost = self._lost()
        if lost is not None:
            raise self._unbounded(lost)

    def _require_finite(self, limits: FloatArray) -> None:
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
                "finite corners. Give these gears a torque_limit in robot.toml."
            )

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


@dataclass(frozen=True, eq=False)
class Holding:
    """Rotor torques that hold a force on a contact point at rest.

    At rest a mesh bears T for any input torque in [eta_b T, T/eta_f], and the rotor's dry friction
    widens that interval. The weight of the links is not counted.

    Attributes:
        joints: names of the gears.
        lossless: |T|/N (m,) [N m], with perfect gears.
        least: (m,) [N m], the least torque that holds; 0 where the gear locks itself.
        most: (m,) [N m], the torque above which the gear starts to lift.
        heat_lossless: Joule heat [W] of `lossless`; NaN where a motor's constants are unknown.
        heat_least: Joule heat [W] of `least`; NaN likewise.
        heat_saved: share of the heat that stiction saves, 0 to 1. Where the motors' constants are
            unknown all motors count as equal.
    """

    joints: tuple[str, ...]
    lossless: FloatArray
    least: FloatArray
    most: FloatArray
    heat_lossless: float
    heat_least: float
    heat_saved: float


def holding(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike,
    load: float,
    axes: str = "xyz",
) -> Holding:
    """Return what holding a force of `load` [N] along `direction` asks of the motors.

    Args:
        robot: fixed or floating base; on a floating base the force is taken as given, whether or
            not the robot could balance on it.
        position: q (nq,).
        contact: name of the contact point.
        direction: (n,) along `axes`, of the force on the point.
        load: its size [N], >= 0.
        axes: world axes, for example "xz".

    Raises:
        DynamicsError: axes that do not exist, a negative load.
    """
    if not 0.0 <= load < np.inf:
        raise DynamicsError(f"load must be >= 0 and finite, got {load}.")
    reach = force_capability(robot, position, contact, axes)
    gears = robot.transmission
    output = np.zeros(gears.size)
    output[list(reach.gears)] = load * (reach.torque_from_force @ reach.task.direction(direction))
    ratio, friction = np.abs(gears.gear_ratio), gears.rotor_coulomb_friction
    perfect = np.abs(output) / ratio
    eased = np.abs(output) * np.maximum(gears.backward_efficiency, 0.0) / ratio - friction
    least = np.maximum(eased, 0.0)
    copper = gears.copper_loss
    known = bool(np.isfinite(copper).all())
    weight = copper if known else np.ones(gears.size)
    spent, rest = float(weight @ perfect**2), float(weight @ least**2)
    return Holding(
        joints=gears.joints,
        lossless=frozen(perfect),
        least=frozen(least),
        most=frozen(np.abs(output) / gears.forward_efficiency / ratio + friction),
        heat_lossless=spent if known else float("nan"),
        heat_least=rest if known else float("nan"),
        heat_saved=1.0 - rest / spent if spent > 0.0 else 0.0,
    )


def backdriving_torque(robot: Robot) -> FloatArray:
    """Return the torque (m,) [N m] at each motor output that turns an unpowered gear.

    N tau_c / eta_b with the rotor's dry friction tau_c: 0 without it, infinite for a self-locking
    gear.
    """
    gears = robot.transmission
    safe = np.where(gears.self_locking, 1.0, gears.backward_efficiency)
    torque = np.abs(gears.gear_ratio) * gears.rotor_coulomb_friction / safe
    return frozen(np.where(gears.self_locking, np.inf, torque))


def backdriving_force(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike,
    axes: str = "xyz",
) -> float:
    """Return the force [N] along `direction` at which the first unpowered gear gives way.

    Args:
        robot: fixed or floating base.
        position: q (nq,).
        contact: name of the contact point.
        direction: (n,) along `axes`.
        axes: world axes, for example "xz".

    Raises:
        DynamicsError: a direction in which the structure bears the force without any torque.
    """
    reach = force_capability(robot, position, contact, axes)
    lever = reach.levers(direction)
    limits = backdriving_torque(robot)[list(reach.gears)]
    loaded = lever > 0.0
    return float(np.min(limits[loaded] / lever[loaded]))
