"""What a log needs."""

from __future__ import annotations

from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.robot import Motion, Robot


def needed(robot: Robot, motion: Motion) -> FloatArray:
    """Return the torque (N, m) [N m] at the outputs of the motors that the drives report."""
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    return torque * robot.transmission.gear_ratio
