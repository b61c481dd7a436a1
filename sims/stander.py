"""A planar leg that stands still under a policy of rest, and what that costs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sims.leg import stance_controller, stance_references
from wbc import Robot
from wbc.arrays import FloatArray
from wbc.control import ControllerSettings, RestPolicy
from wbc.dynamics import evaluate
from wbc.measurement import Log
from wbc.sim import SensorNoise, SimState


def standing_loop(
    robot: Robot, q: FloatArray, policy: RestPolicy, noise: float = 0.0
) -> Callable[[SimState], FloatArray]:
    """Return a controller that keeps the leg standing in pose q, speeds measured with noise."""
    controller = stance_controller(robot, ControllerSettings(rest_policy=policy))
    height = evaluate(robot, q, np.zeros(robot.model.nv)).center_of_mass[2:]
    references = stance_references(np.array([height[0], 0.0, 0.0]))
    sensors = SensorNoise(robot, velocity=noise, seed=1)

    def torque(state: SimState) -> FloatArray:
        return controller.step(sensors(state), references).rotor_torque

    return torque


def standing_cost(robot: Robot, log: Log) -> tuple[float, float]:
    """Return mean knee torque [N m] and Joule heat [W] of a log of standing."""
    gears = robot.transmission
    torque = np.stack([log.column(f"{j}.rotor_torque") for j in gears.joints], axis=1)
    heat = gears.resistance * (torque / gears.torque_constant) ** 2
    return float(np.abs(torque[:, 1]).mean()), float(heat.sum(axis=1).mean())
