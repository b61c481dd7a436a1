"""Motions of a robot, and what a log of them needs."""

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.robot import Motion, Robot


def needed(robot: Robot, motion: Motion) -> FloatArray:
    """Return the torque (N, m) [N m] at the outputs of the motors that the drives report."""
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    return torque * robot.transmission.gear_ratio


def motion_of(robot: Robot, samples: int = 50) -> Motion:
    """Return random q, v and a of motors at 60 C behind 24 V."""
    q, v, a = np.random.default_rng(9).normal(size=(3, samples, robot.model.nv))
    warm, volts = np.full((2, samples, robot.transmission.size), [[[60.0]], [[24.0]]])
    time = 0.01 * np.arange(samples)
    return Motion(q, v, a, time=time, temperature=warm, supply_voltage=volts)
