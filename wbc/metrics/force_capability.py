"""Asymmetric force capability: what a leg can lift, and what it can hold.

Sim & Ramos, section IV.B.2: J_m^-T B E_m convhull(tau_phi). The statics read backwards need no
inverse: a force f on the point asks gear torques T = D' J_m' f, and each gear passes at most
eta_f U (lifting) or U/eta_b (holding) of its motor's U = N tau_max. At rest both are ends of one
interval (correction 7 in docs/method/physics.md). Which end counts depends on where the point is
about to move: `moving` gives one polygon in which each gear whose power runs with the motion lifts
and each other one holds. The weight of the links is not counted, as in the paper.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import HalfspaceIntersection

from wbc.arrays import FloatArray, frozen
from wbc.errors import DynamicsError
from wbc.metrics.designs import NOTHING, ContactTask, contact_task, ratio
from wbc.robot import Robot
from wbc.transmission import Direction


@dataclass(frozen=True)
class ForceRange:
    """The largest force along one direction [N].

    Attributes:
        conventional: with perfect gears.
        lift: that the motors can raise, all gears forward.
        hold: that the motors can resist, all gears backward; infinite where a gear locks itself.
        backdriving_force: at which the first gear without power gives way.
    """

    conventional: float
    lift: float
    hold: float
    backdriving_force: float


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
        """Return the largest gear torque |T| (k,) [N m] at the motor output; see `limits_of`.

        Args:
            directions: per gear of the robot (m,) or one for all: +1 lift, -1 hold, 0 without
                losses.
        """
        return np.asarray(limits_of(self.task.designs.gears, directions)[0, list(self.gears)])

    def along(self, direction: ArrayLike) -> ForceRange:
        """Return the largest force along `direction` (n,), no force across it.

        Raises:
            DynamicsError: a direction in which the structure carries the force without any
                torque (a singular pose).
        """
        n = self.task.direction(direction)
        if not self.task.levers(n).any():
            raise self._unbounded(n)
        found = forces_along(self.task, n)
        return ForceRange(**{name: float(force[0]) for name, force in found.items()})

    @property
    def backdriving_torque(self) -> FloatArray:
        """Torque (m,) [N m] at each motor output that turns an unpowered gear of the robot.

        N tau_c / eta_b with the rotor's dry friction tau_c: 0 without it, infinite for a
        self-locking gear.
        """
        return frozen(unpowered_limits(self.task.designs.gears)[0])

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
        n = self.task.direction(direction)
        jacobian = self.task.jacobian[0]
        moved = self.task.response(Direction.STUCK, jacobian.T[None])[0]
        path = moved @ np.linalg.lstsq(jacobian @ moved, n, rcond=None)[0]
        turning = (self.task.designs.robot.motor_rows @ path)[list(self.gears)]
        turning[np.abs(turning) <= NOTHING * np.abs(turning).max(initial=0.0)] = 0.0
        lift, hold = self.limits(Direction.FORWARD), self.limits(Direction.BACKWARD)
        high = np.where(turning > 0.0, lift, hold)
        low = np.where(turning < 0.0, -lift, -hold)
        return self._corners(low, high)

    def vertices(self, directions: ArrayLike) -> FloatArray:
        """Return the corners (c, n) [N] of the polytope: of a polygon in order around it.

        Args:
            directions: +1 lift, -1 hold, 0 without losses, per gear or one for all.

        Raises:
            DynamicsError: a singular pose, or a gear without torque limit: no finite corners.
        """
        limits = self.limits(directions)
        return self._corners(-limits, limits)

    def _corners(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return the corners (c, n) of {f : low <= T_from_f f <= high}, 0 inside, see `vertices`.

        Raises:
            DynamicsError: a direction in which no gear bears a force; an open end.
        """
        matrix = self.torque_from_force
        _, sizes, ways = np.linalg.svd(matrix)
        least = 0.0 if len(sizes) < len(ways) else sizes[-1]
        if least <= NOTHING * np.abs(matrix).max(initial=NOTHING):
            raise self._unbounded(ways[-1])
        closed = (low > -np.inf) & (low < 0.0) & (high > 0.0) & (high < np.inf)
        if not closed.all():
            joints = np.array(self.task.designs.robot.transmission.joints)[list(self.gears)]
            raise DynamicsError(
                f"the gears of {', '.join(joints[~closed])} hold any torque or none (no "
                "torque_limit, a self-locking gear, or friction above the limit): the force "
                "capability has no finite corners. Give these gears a torque_limit in robot.toml."
            )
        if matrix.shape[1] == 1:
            lever = matrix[:, 0]
            ends = np.where(lever > 0.0, [low, high], [high, low])[:, lever != 0.0]
            below, above = ends / lever[lever != 0.0]
            return np.array([[below.max()], [above.min()]])
        half = np.column_stack([np.vstack([matrix, -matrix]), np.concatenate([-high, low])])
        corners = HalfspaceIntersection(half, np.zeros(matrix.shape[1])).intersections
        # Corners where several faces meet come out once per set of faces.
        rounded = np.round(corners / np.abs(corners).max(), 9)
        return _around(corners[np.unique(rounded, axis=0, return_index=True)[1]])

    def _unbounded(self, direction: FloatArray) -> DynamicsError:
        along = ", ".join(f"{x:.3g}" for x in direction)
        return DynamicsError(
            f"a force on '{self.task.contact}' along [{along}] (axes {self.task.axes}) loads no "
            "motor in this pose: no torque limits it. Leave the singular pose, or choose the "
            "axes that the leg's motors act on (for example axes='xz')."
        )


def _around(corners: FloatArray) -> FloatArray:
    """Return the corners of a polygon in order around it; others as they are."""
    if corners.shape[1] != 2:
        return corners
    x, y = (corners - corners.mean(axis=0)).T
    return np.asarray(corners[np.argsort(np.arctan2(y, x))])


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
    # All three axes, so that a gear counts even in one bad pose.
    full = replace(task, axes="xyz").torque_from_force[0]
    used = np.flatnonzero(np.abs(full).max(axis=1, initial=0.0) > NOTHING)
    return ForceCapability(task, tuple(used.tolist()), frozen(task.torque_from_force[0, used]))


def limits_of(gears: Mapping[str, FloatArray], directions: ArrayLike) -> FloatArray:
    """Return the largest torque |T| (k or 1, m) [N m] that each gear passes at the motor output.

    Rotor Coulomb friction takes its part of the motor's torque when lifting and adds it when
    holding.

    Args:
        gears: arrays of `Designs.gears`.
        directions: per gear (m,) or one for all: +1 lift, -1 hold, 0 without losses.
    """
    mode = np.asarray(directions, dtype=np.float64)
    reach = gears["torque_limit"] - np.sign(mode) * gears["rotor_coulomb_friction"]
    motor = np.abs(gears["gear_ratio"]) * np.maximum(reach, 0.0)
    held = ratio(motor, gears["backward_efficiency"], 0.0, np.inf)
    lifted = gears["forward_efficiency"] * motor
    return np.asarray(np.where(mode > 0.0, lifted, np.where(mode < 0.0, held, motor)))


def unpowered_limits(gears: Mapping[str, FloatArray]) -> FloatArray:
    """Return the torque (k or 1, m) [N m] at each motor output that turns an unpowered gear."""
    return limits_of({**gears, "torque_limit": np.zeros((1, 1))}, Direction.BACKWARD)


def forces_along(task: ContactTask, n: FloatArray) -> dict[str, FloatArray]:
    """Return the forces (k,) [N] along n at which the first gear reaches its limit.

    With perfect gears, lifting, holding, and without power; infinite without a limit.
    """
    gears, lever = task.designs.gears, task.levers(n)
    limits = {
        "conventional": limits_of(gears, Direction.STUCK),
        "lift": limits_of(gears, Direction.FORWARD),
        "hold": limits_of(gears, Direction.BACKWARD),
        "backdriving_force": unpowered_limits(gears),
    }
    return {name: ratio(own, lever, 0.0, np.inf).min(axis=1) for name, own in limits.items()}


@dataclass(frozen=True, eq=False)
class Holding:
    """Rotor torques that hold a force on a contact point at rest.

    At rest a mesh bears T for any input torque in [eta_b T, T/eta_f], and the rotor's dry friction
    widens that interval. The weight of the links is not counted.

    Attributes:
        lossless: |T|/N (m,) [N m], with perfect gears.
        least: (m,) [N m], the least torque that holds; 0 where the gear locks itself.
        heat_lossless: Joule heat [W] of `lossless`; NaN where a motor's constants are unknown.
        heat_least: Joule heat [W] of `least`; NaN likewise.
        heat_saved: share of the heat that stiction saves, 0 to 1. Where the motors' constants are
            unknown all motors count as equal.
    """

    lossless: FloatArray
    least: FloatArray
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
        position, contact, axes: as of `force_capability`.
        direction: (n,) along `axes`, of the force on the point.
        load: its size [N], >= 0.

    Raises:
        DynamicsError: axes that do not exist, a negative load.
    """
    if not 0.0 <= load < np.inf:
        raise DynamicsError(f"load must be >= 0 and finite, got {load}.")
    task = contact_task(robot, position, contact, axes)
    lossless, least, *heats = holding_of(task, task.direction(direction), load)
    known = 1.0 if np.isfinite(robot.transmission.copper_loss).all() else np.nan
    spent, rest, saved = (float(heat[0]) for heat in heats)
    return Holding(frozen(lossless[0]), frozen(least[0]), known * spent, known * rest, saved)


def holding_of(task: ContactTask, n: FloatArray, load: float) -> tuple[FloatArray, ...]:
    """Return the fields of `Holding` for every design: two (k, m), then three (k,).

    The motors count as equal where the constants of one are unknown, in all heats.
    """
    gears, copper = task.designs.gears, task.designs.robot.transmission.copper_loss
    lossless = np.abs(task.torque_from_force @ n * load / gears["gear_ratio"])
    least = lossless * np.maximum(gears["backward_efficiency"], 0.0)
    least = np.maximum(least - gears["rotor_coulomb_friction"], 0.0)
    weight = np.where(np.isfinite(copper).all(), copper, 1.0)
    spent, rest = (np.sum(weight * torque**2, axis=1) for torque in (lossless, least))
    return lossless, least, spent, rest, 1.0 - ratio(rest, spent, 0.0, 1.0)
