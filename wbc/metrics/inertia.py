"""Generalized inertia tensors of a contact point: how heavy the robot feels there.

Sim & Ramos, section IV.B.1, after Asada's generalized inertia ellipsoid.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, frozen
from wbc.errors import DynamicsError
from wbc.metrics.contact_task import ContactTask, contact_task
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
        position: q (nq,).
        contact: name of the contact point.
        axes: world axes of the n rows, for example "xz" for a planar contact.
        directions: of power per gear, (m,) or one for all. An impact that sets the gears in
            motion drives them backward; 0 is the conservative factor without losses.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
    """
    task = contact_task(robot, position, contact, axes)
    return ImpactMitigation(task, frozen(task.mobility(directions)[0]), frozen(task.blocked()[0]))
