"""How heavy a robot feels at a contact point: tensors, and the exact inertia by direction.

Sim & Ramos, section IV.B.1, after Asada's generalized inertia ellipsoid. A tensor assumes one
direction of power in every gear. The set-valued mesh law says which gears drive, are driven or
stand still for each force, and so how the point really starts to move.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.errors import DynamicsError
from wbc.metrics.designs import NOTHING, ContactTask, contact_task, ratio
from wbc.robot import Robot
from wbc.transmission import Direction


def generalized_inertia(
    robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz"
) -> FloatArray:
    """Return GIT = (J H^-1 J')^-1 (n, n) [kg] of the robot with perfect gears.

    Args:
        robot: fixed or floating base.
        position: q (nq,).
        contact: name of the contact point.
        axes: world axes of the n rows, for example "xz" for a planar contact.

    Raises:
        DynamicsError: a singular pose, or axes that do not exist.
    """
    task = contact_task(robot, position, contact, axes)
    return task.inverted(task.mobility(Direction.STUCK)[0], "the inertia tensor")


def backward_generalized_inertia(
    robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz"
) -> FloatArray:
    """Return Backward-GIT = (J H^-1 J')^-1 (n, n) [kg], every gear driven by its joint.

    It is what an external force feels that accelerates the robot from rest: each reflected rotor
    inertia counts 1/eta_b times. A self-locking gear (eta_b <= 0) does not give way at all.
    Symmetric where the rotors do not couple inertially with the links.

    Raises:
        DynamicsError: a singular pose, or axes that do not exist.
    """
    task = contact_task(robot, position, contact, axes)
    return task.inverted(task.mobility(Direction.BACKWARD)[0], "the Backward-GIT")


def forward_generalized_inertia(
    robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz"
) -> FloatArray:
    """Return Forward-GIT = (J H^-1 B E_m B^-1 J')^-1 (n, n) [kg], every gear driven by its motor.

    It is what the motors feel when they accelerate the contact point from rest. Not symmetric
    when the efficiencies differ: its ellipsoid is that of the symmetric part, and it holds
    only where every gear runs forward (correction 4 in docs/method/physics.md).

    Raises:
        DynamicsError: a robot with undriven coordinates (a floating base), on which
            tau_phi = B^-1 J' f does not determine the motion; a singular pose.
    """
    if robot.floating_size:
        raise DynamicsError(
            f"the Forward-GIT needs a gear on every coordinate; '{robot.name}' leaves "
            f"{robot.floating_size} of {robot.model.nv} undriven. Use the same robot with its "
            "base fixed (lock the base's joints in robot.toml)."
        )
    task = contact_task(robot, position, contact, axes)
    return task.inverted(task.forward_mobility()[0], "the Forward-GIT")


@dataclass(frozen=True, eq=False)
class ImpactMitigation:
    """The impact mitigation of one contact point in one pose (Wensing et al. 2017).

    Xi = I - Lambda Lambda_L^-1 with Lambda the inertia felt by an impact and Lambda_L that of the
    same robot with its gears blocked. 1 is a leg that gives way freely, 0 a rigid one.

    Attributes:
        task: the contact point and pose.
        free: Lambda^-1 (n, n) [1/kg].
        blocked: Lambda_L^-1 (n, n) [1/kg]; zero on a fixed base, which a blocked leg cannot move.
    """

    task: ContactTask
    free: FloatArray
    blocked: FloatArray

    @cached_property
    def matrix(self) -> FloatArray:
        """Xi = I - Lambda Lambda_L^-1, (n, n).

        Raises:
            DynamicsError: a singular pose, in which some direction meets infinite inertia.
        """
        inertia = self.task.inverted(self.free, "the impact mitigation")
        return frozen(np.eye(len(inertia)) - inertia @ self.blocked)

    @property
    def determinant(self) -> float:
        """det Xi, the factor over all axes at once."""
        return float(np.linalg.det(self.matrix))

    def along(self, direction: ArrayLike) -> float:
        """Return 1 - (n' Lambda_L^-1 n)/(n' Lambda^-1 n) for a frictionless impact along n.

        Args:
            direction: (n,) along the task's axes, of any length.

        Raises:
            DynamicsError: a direction in which the point cannot move at all.
        """
        n = self.task.direction(direction)
        give = self.task.inverted(np.atleast_2d(n @ self.free @ n), "the impact mitigation")
        return float(1.0 - (n @ self.blocked @ n) * give[0, 0])


def impact_mitigation(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    axes: str = "xyz",
    directions: ArrayLike = Direction.BACKWARD,
) -> ImpactMitigation:
    """Return the impact mitigation at a contact point.

    Args:
        robot: fixed or floating base. On a fixed base nothing moves when the gears are blocked:
            the factor is 1 whatever the gears.
        position, contact, axes: as of `generalized_inertia`.
        directions: of power per gear, (m,) or one for all. An impact that sets the gears in
            motion drives them backward; 0 is the conservative factor without losses.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
    """
    task = contact_task(robot, position, contact, axes)
    return ImpactMitigation(task, frozen(task.mobility(directions)[0]), frozen(task.blocked()[0]))


@dataclass(frozen=True, eq=False)
class DirectionalInertia:
    """Effective masses 1/(n' a(n)) at a point that starts from rest under a unit force along n.

    Attributes:
        directions: n (k, d) unit vectors along the task's axes.
        lossless: (k,) [kg], perfect gears.
        pushed: (k,) [kg], an external force on the point, motors without torque. Every gear that
            moves is driven by its joint, so that this is the Backward-GIT's.
        driven: (k,) [kg], motor torques B^-1 J' n that a force n needs with perfect gears; exact,
            from the set-valued mesh law. Infinite where friction holds the point.
        forward_tensor: (k,) [kg], what the Forward-GIT says of the same torques; NaN on a
            floating base, where it does not exist.
        all_forward: (k,) bool, whether every gear that the contact loads drives forward. On a fixed
            base the Forward-GIT is exact there.
        stuck: (k, m) bool, which gears stand still.
    """

    directions: FloatArray
    lossless: FloatArray
    pushed: FloatArray
    driven: FloatArray
    forward_tensor: FloatArray
    all_forward: BoolArray
    stuck: BoolArray

    @property
    def share_forward(self) -> float:
        """Share of the directions of force in which every gear drives forward."""
        return float(self.all_forward.mean())


def directional_inertia(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    axes: str = "xyz",
    directions: ArrayLike | int = 360,
) -> DirectionalInertia:
    """Return the effective mass of a contact point in many directions.

    Args:
        robot, position, contact, axes: as of `generalized_inertia`.
        directions: (k, d) along `axes`, or how many to spread evenly.

    Raises:
        DynamicsError: axes that do not exist, a direction of zero, rotors that couple inertially.
    """
    task = contact_task(robot, position, contact, axes)
    n = _directions(task, directions)
    motor = task.torque_from_force[0] @ n.T
    used = np.abs(motor).max(axis=1) > NOTHING * np.abs(motor).max()
    moved, output = _from_rest(task, motor)
    mesh = motor - robot.transmission.reflected_inertia[:, None] * output
    forward = frozen(np.full(len(n), np.nan))
    if not robot.floating_size:
        forward = _mass(n, task.forward_mobility()[0] @ n.T)
    return DirectionalInertia(
        directions=frozen(n),
        lossless=_mass(n, task.mobility(Direction.STUCK)[0] @ n.T),
        pushed=_mass(n, task.mobility(Direction.BACKWARD)[0] @ n.T),
        driven=_mass(n, task.jacobian[0] @ moved),
        forward_tensor=forward,
        all_forward=frozen((mesh * output > 0.0)[used].all(axis=0), np.bool_),
        stuck=frozen((output == 0.0).T, np.bool_),
    )


def _mass(n: FloatArray, acceleration: FloatArray) -> FloatArray:
    return frozen(ratio(1.0, np.sum(n.T * acceleration, axis=0), 0.0, np.inf))


def _directions(task: ContactTask, directions: ArrayLike | int) -> FloatArray:
    size = len(task.axes)
    if not isinstance(directions, int):
        rows = np.atleast_2d(np.asarray(directions, dtype=np.float64))
        return np.array([task.direction(row) for row in rows])
    if directions < 1:
        raise DynamicsError(f"directions must be at least 1, got {directions}.")
    if size == 1:
        return np.array([[1.0], [-1.0]])
    if size == 2:
        angle = 2.0 * np.pi * (np.arange(directions) + 0.5) / directions
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # Fibonacci's spiral spreads points evenly on a sphere.
    rank = np.arange(directions) + 0.5
    height, turn = 1.0 - 2.0 * rank / directions, np.pi * (1.0 + np.sqrt(5.0)) * rank
    wide = np.sqrt(1.0 - height**2)
    return np.stack([wide * np.cos(turn), wide * np.sin(turn), height], axis=1)


_LEAST_BACKWARD = 1e-9  # eta_b of a self-locking gear, the limit eta_b -> 0: test_inertia.py
_SWEEPS = 2000  # bound only: measured 10 to 60 on the shipped robots, a serial arm of six axes 200
_CLOSE = 1e-12  # relative change per sweep at which the states of the gears are read off


def _from_rest(task: ContactTask, motor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return accelerations from rest: of the coordinates (nv, k), of the motor outputs (m, k).

    Those of the outputs are exactly 0 where friction holds a gear. Gravity is left out.

    Args:
        task: contact point and pose of one robot.
        motor: U (m, k) [N m], rotor torques times the gear ratio.

    Raises:
        DynamicsError: rotors that couple inertially with the links, or rotors without inertia in a
            gear that nothing else stops (no unique solution).
    """
    robot = task.designs.robot
    if robot.rotors_turn_with_links:
        raise DynamicsError(
            f"'{robot.name}' couples rotors and links inertially; the exact response leaves that "
            "out. Load it without rotors_turn_with_links."
        )
    gears, driven, rest = robot.transmission, robot.actuated, robot.unactuated
    H = task.mass_matrix[0]
    # Only the undriven coordinates are eliminated: a driven link may have no inertia of its own
    # (a drawn wrist), its rotor has some.
    held = np.linalg.solve(H[np.ix_(rest, rest)], H[np.ix_(rest, driven)])
    M = gears.topology.T @ (H[np.ix_(driven, driven)] - H[np.ix_(driven, rest)] @ held)
    rotor, forward = gears.reflected_inertia[:, None], gears.forward_efficiency[:, None]
    backward = np.maximum(gears.backward_efficiency, _LEAST_BACKWARD)[:, None]
    output = _gear_acceleration(M @ gears.topology, motor, rotor, forward, backward)
    acceleration = np.zeros((robot.model.nv, motor.shape[1]))
    acceleration[driven] = gears.topology @ output
    acceleration[rest] = -held @ acceleration[driven]
    return acceleration, output


def _gear_acceleration(
    M: FloatArray, motor: FloatArray, rotor: FloatArray, forward: FloatArray, backward: FloatArray
) -> FloatArray:
    """Return x (m, k) with M x in the set T(x), row by row in turn (a convex program)."""
    x = np.zeros_like(motor)
    for _ in range(_SWEEPS):
        before = x.copy()
        for i in range(len(x)):
            r = M[i] @ x - M[i, i] * x[i]
            one = (forward[i] * motor[i] - r) / (M[i, i] + forward[i] * rotor[i])
            # Multiplied by eta_b, which may be tiny.
            other = (motor[i] - backward[i] * r) / (backward[i] * M[i, i] + rotor[i])
            low, high = np.minimum(one, other), np.maximum(one, other)
            x[i] = np.maximum(low, 0.0) + np.minimum(high, 0.0)
        if np.all(np.abs(x - before) <= _CLOSE * np.abs(x).max(axis=0)):
            break
    # One linear solve per column, each gear in the state that the sweeps found.
    eta = np.where((motor - rotor * x) * x >= 0.0, forward, 1.0 / backward)
    solved = np.zeros_like(x)
    for k in range(x.shape[1]):
        go = np.flatnonzero(x[:, k])
        left = M[np.ix_(go, go)] + np.diag((eta * rotor)[go, k])
        solved[go, k] = np.linalg.solve(left, eta[go, k] * motor[go, k])
    return solved
