"""Logs of robots on sums of sines, made by inverse dynamics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.dynamics import link_torque, rotor_torque
from wbc.measurement import Log
from wbc.robot import Motion, Robot


def moved(
    robot: Robot,
    time: np.ndarray,
    waves: ArrayLike,
    noise: tuple[float, float, float] = (2e-5, 3e-3, 2e-3),
    seed: int = 0,
) -> Log:
    """Return a log of `robot`: exact torques and sensor noise.

    Args:
        waves: (joints, k, 3) size [rad], rate [rad/s] and phase [rad] of sines.
        noise: of position [rad], velocity [rad/s] and rotor torque [N m].
    """
    size, rate, phase = np.moveaxis(np.asarray(waves), -1, 0)[..., None]
    angle = rate * time + phase
    parts = (size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle))
    motion = Motion(*(np.sum(part, axis=1).T for part in parts), time=time)
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    drawn = np.random.default_rng(seed).standard_normal((len(robot.joints), 3, len(time)))
    columns = {}
    for i, joint in enumerate(robot.joints):
        for k, (name, values) in enumerate(
            (("position", motion.position), ("velocity", motion.velocity), ("rotor_torque", torque))
        ):
            columns[f"{joint}.{name}"] = values[:, i] + noise[k] * drawn[i, k]
    return Log(time, columns)


def swing(robot: Robot, seed: int, phase: float = 0.0, seconds: float = 6.0) -> Log:
    """Return a log of the fixed leg on two sines per joint."""
    rates = np.array([[2.3, 5.1], [3.1, 6.7]])
    waves = np.stack([np.full((2, 2), 0.35), rates, phase * rates[:, ::-1]], axis=-1)
    return moved(robot, np.arange(0.0, seconds, 4e-3), waves, seed=seed)
