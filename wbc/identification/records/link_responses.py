"""How links react to deflections of their gears along a log: derivatives of what they need."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import contact_torque, inertial_regressor, link_torque
from wbc.robot import Motion, Robot

_SMALL = 1e-6

Columns = tuple[FloatArray, FloatArray, FloatArray]
"""Derivatives of a torque by one joint's acceleration, velocity and position."""


def torque_columns(
    robot: Robot, motion: Motion, joint: str, links: FloatArray, forces: Mapping[str, FloatArray]
) -> Columns:
    """Return how the links' torque (N, nv) changes with one joint, (N, nv) each.

    Args:
        robot: whose links.
        motion: along the log.
        joint: name.
        links: the torque that the links need (N, nv) [N m].
        forces: contact name -> (N, 3) [N]; their torque turns with the joint.
    """
    inertia, damping, stiffness = _columns(
        motion, robot, joint, links, lambda moved: link_torque(robot, moved)
    )
    bent = _moved(motion, robot, joint)
    turned = contact_torque(robot, bent.position, forces)
    turned = turned - contact_torque(robot, motion.position, forces)
    return inertia, damping, stiffness - turned / _SMALL


def regressor_columns(
    robot: Robot, motion: Motion, joint: str, regressor: FloatArray, kept: IntArray
) -> Columns:
    """Return how the regressor of some link parameters changes with one joint, (N, nv, p) each.

    Args:
        robot: whose links.
        motion: along the log.
        joint: name.
        regressor: of the links (N, nv, 10 n_links).
        kept: the numbers (p,) of the parameters.
    """
    return _columns(
        motion,
        robot,
        joint,
        regressor[:, :, kept],
        lambda moved: inertial_regressor(robot, moved)[:, :, kept],
    )


def _columns(
    motion: Motion,
    robot: Robot,
    joint: str,
    here: FloatArray,
    needed: Callable[[Motion], FloatArray],
) -> Columns:
    unit = np.eye(robot.model.nv)[robot.velocity_index(joint)]
    acceleration = np.zeros_like(motion.velocity) + unit
    if motion.acceleration is not None:
        acceleration = acceleration + motion.acceleration
    pushed = motion.replace(acceleration=acceleration)
    faster = motion.replace(velocity=motion.velocity + _SMALL * unit)
    return (
        needed(pushed) - here,
        (needed(faster) - here) / _SMALL,
        (needed(_moved(motion, robot, joint)) - here) / _SMALL,
    )


def _moved(motion: Motion, robot: Robot, joint: str) -> Motion:
    position = np.array(motion.position)
    position[:, robot.position_index(joint)] += _SMALL
    return motion.replace(position=position)
