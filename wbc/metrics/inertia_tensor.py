"""Generalized inertia tensors: how heavy the robot feels at a contact point.

Sim & Ramos, section IV.B.1, after Asada's generalized inertia ellipsoid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.metrics.contact_task import contact_task
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
    return task.inverted(task.mobility(Direction.STUCK), "the inertia tensor")


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
    return task.inverted(task.mobility(Direction.BACKWARD), "the Backward-GIT")


def forward_generalized_inertia(
    robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz"
) -> FloatArray:
    """Return Forward-GIT = (J H^-1 B E_m B^-1 J')^-1 (n, n) [kg], every gear driven by its motor.

    It is what the motors feel when they accelerate the contact point from rest. Not symmetric
    when the efficiencies differ: the ellipsoid is that of the symmetric part
    (`inertia_ellipsoid`), and it holds only where every gear runs forward (correction 4 in
    docs/method/physics.md).

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
    gears = robot.transmission
    through = gears.distribution * gears.forward_efficiency
    torque = np.zeros((robot.model.nv, len(axes)))
    wanted = np.linalg.solve(gears.distribution, task.jacobian.T[robot.actuated])
    torque[robot.actuated] = through @ wanted
    mobility = task.jacobian @ task.response(Direction.FORWARD, torque)
    return task.inverted(mobility, "the Forward-GIT")
