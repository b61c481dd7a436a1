"""Legged robots on their feet: controller, squat and push, whatever the plant is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Contact,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    PointContact,
    PostureTask,
    Reference,
    State,
    SurfaceContact,
)
from wbc.dynamics import Workspace, evaluate

_TRUNK = {"solo12": "base_link", "anymal": "base", "talos": "torso_2_link"}

Act = Callable[[float], tuple[FloatArray, FloatArray]]
"""Time [s] -> height over the start [m] with its two rates (3,), push on the base (3,) [N]."""


def controller(robot: Robot, model: Robot, deadline: float | None = None) -> Controller:
    """Return a controller of centre of mass, trunk and posture that knows `model` of a robot.

    Args:
        robot: decides tasks and feet.
        model: what the controller obeys; `robot.lossless()` makes a conservative one.
        deadline: [s] that a tick may take before it is late.
    """
    trunk = _TRUNK.get(robot.name, "root_joint")
    tasks = [
        CenterOfMassTask(weight=100.0, stiffness=100.0, acceleration_limit=np.inf),
        FrameOrientationTask(name="trunk", frame=trunk, weight=10.0, stiffness=100.0),
        PostureTask.of(robot, weight=0.01, stiffness=50.0),
    ]
    return Controller(model, tasks, feet(robot), settings=ControllerSettings(deadline=deadline))


def feet(robot: Robot) -> list[Contact]:
    """Return Talos' two soles, or a point per contact of the robot."""
    if robot.name != "talos":
        return [PointContact(name=contact.name) for contact in robot.contacts]
    ends = [f"sole_{a}_{b}" for a in ("front", "rear") for b in ("left", "right")]
    return [
        SurfaceContact(name=side, corners=tuple(f"{side}_{end}" for end in ends))
        for side in ("left", "right")
    ]


class CenterOfMass:
    """Measures the centre of mass (3,) [m] of a state."""

    def __init__(self, robot: Robot) -> None:
        """Keep the memory of the evaluation."""
        self._robot, self._space = robot, Workspace(robot)

    def __call__(self, state: State) -> FloatArray:
        """Return it for one state."""
        terms = evaluate(self._robot, state.position, state.velocity, self._space)
        return np.array(terms.data.com[0])


def stand(time: float) -> tuple[FloatArray, FloatArray]:
    """Do nothing."""
    return np.zeros(3), np.zeros(3)


def squat(depth: float, rate: float) -> Act:
    """Return squats of a depth [m] at a rate [1/s]."""

    def act(time: float) -> tuple[FloatArray, FloatArray]:
        w = 2.0 * np.pi * rate
        s, c = np.sin(w * time), np.cos(w * time)
        height = 0.5 * depth * np.array([c - 1.0, -w * s, -(w**2) * c])
        return height, np.zeros(3)

    return act


def pushed(force: FloatArray, start: float, length: float) -> Act:
    """Return standing under a force (3,) [N] on the base from `start` for `length` [s]."""

    def act(time: float) -> tuple[FloatArray, FloatArray]:
        return np.zeros(3), force if start <= time < start + length else np.zeros(3)

    return act


def com_reference(start: FloatArray, height: FloatArray) -> tuple[FloatArray, Reference]:
    """Return where the centre of mass should be for a height over its start, and the reference."""
    up = np.array([0.0, 0.0, 1.0])
    target = start + height[0] * up
    return target, Reference(target, height[1] * up, height[2] * up)
