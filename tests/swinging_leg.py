"""Logs of the fixed leg on a motion of two sines per joint, made by inverse dynamics."""

from __future__ import annotations

import numpy as np

from wbc.dynamics import link_torque, rotor_torque
from wbc.measurement import Log
from wbc.robot import Motion, Robot


def swing(robot: Robot, seed: int, phase: float = 0.0, seconds: float = 6.0) -> Log:
    """Return a log of `robot`: exact torques and sensor noise."""
    time = np.arange(0.0, seconds, 4e-3)
    rng = np.random.default_rng(seed)
    rates = np.array([[2.3, 5.1], [3.1, 6.7]])
    parts = rates[:, :, None] * time + phase * rates[:, ::-1, None]
    q = np.sum(0.35 * np.sin(parts), axis=1).T
    v = np.sum(0.35 * rates[:, :, None] * np.cos(parts), axis=1).T
    a = np.sum(-0.35 * rates[:, :, None] ** 2 * np.sin(parts), axis=1).T
    motion = Motion(q, v, a, time=time)
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    columns = {}
    for i, joint in enumerate(robot.joints):
        columns[f"{joint}.position"] = q[:, i] + 2e-5 * rng.standard_normal(len(time))
        columns[f"{joint}.velocity"] = v[:, i] + 3e-3 * rng.standard_normal(len(time))
        columns[f"{joint}.rotor_torque"] = torque[:, i] + 2e-3 * rng.standard_normal(len(time))
    return Log(time, columns)
