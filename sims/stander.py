"""A planar leg that stands still under a policy of rest, and what that costs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    RestPolicy,
)
from wbc.dynamics import evaluate
from wbc.measurement import Log
from wbc.sim import SimState


def standing_loop(
    robot: Robot, q: FloatArray, policy: RestPolicy, noise: float = 0.0
) -> Callable[[SimState], FloatArray]:
    """Return a controller that keeps the leg standing in pose q, speeds measured with noise."""
    tasks = [
        CenterOfMassTask(name="height", axes="z", weight=100.0, stiffness=400.0),
        PointFootBalanceTask(contact="foot", frame="base", weight=100.0),
        PostureTask.of(robot, weight=1e-3),
    ]
    settings = ControllerSettings(rest_policy=policy)
    controller = Controller(robot, tasks, [PointContact(name="foot")], settings=settings)
    height = evaluate(robot, q, np.zeros(robot.model.nv)).center_of_mass[2:]
    references = {"height": Reference(height), "balance": Reference(0.0)}
    random = np.random.default_rng(1)

    def torque(state: SimState) -> FloatArray:
        seen = state.velocity + noise * random.standard_normal(robot.model.nv)
        return controller.step(state.replace(velocity=seen), references).rotor_torque

    return torque


def standing_cost(robot: Robot, log: Log) -> tuple[float, float]:
    """Return mean knee torque [N m] and Joule heat [W] of a log of standing."""
    gears = robot.transmission
    torque = np.stack([log.column(f"{j}.rotor_torque") for j in gears.joints], axis=1)
    heat = gears.resistance * (torque / gears.torque_constant) ** 2
    return float(np.abs(torque[:, 1]).mean()), float(heat.sum(axis=1).mean())
