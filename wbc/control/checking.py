"""What tasks and contacts say about their derivatives, held against differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.rows.contacts import Contact, ContactSet
from wbc.control.rows.task import Task
from wbc.robot import Robot


@dataclass(frozen=True)
class DerivativeErrors:
    """Largest differences between stated and finite-difference derivatives.

    Attributes:
        jacobian: of J v against the rate of -error for a fixed target (or of the value's own
            motion), in the task's unit per second.
        drift: of J qdd + dJ/dt v against the rate of J v.
    """

    jacobian: float
    drift: float


def check_task(
    robot: Robot,
    task: Task,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    *,
    step: float = 1e-5,
) -> DerivativeErrors:
    """Return how far a task's Jacobian and drift are from central differences.

    The error's rate is checked about its own present value, where it must be -J v; a task whose
    value is itself a rate (momentum) is checked by J v = value instead.

    Args:
        robot: the robot.
        task: any task.
        position, velocity, acceleration: (nq,), (nv,), (nv,) of the motion to go along.
        step: of the differences [s].
    """
    task.check(robot)
    at = _along(robot, position, velocity, acceleration)
    here, ahead, behind = at(0.0), at(step), at(-step)
    target, rate = task.value(here), task.jacobian(here) @ velocity
    if np.shape(target) == rate.shape and np.allclose(target, rate, rtol=1e-9, atol=1e-9):
        jacobian = float(np.abs(np.asarray(target) - rate).max())
    else:
        gone = (task.error(ahead, target) - task.error(behind, target)) / (2.0 * step)
        jacobian = float(np.abs(gone + rate).max())
    stated = task.jacobian(here) @ acceleration + task.drift(here)
    found = task.jacobian(ahead) @ ahead.velocity - task.jacobian(behind) @ behind.velocity
    return DerivativeErrors(jacobian, float(np.abs(stated - found / (2.0 * step)).max()))


def check_contact(
    robot: Robot,
    contact: Contact,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    *,
    step: float = 1e-5,
) -> float:
    """Return how far J qdd + dJ/dt v of a contact is from the central difference of J v."""
    bound = contact.bind(robot)
    at = _along(robot, position, velocity, acceleration, bound.frames)
    rows, rates = ContactSet((bound,), at(0.0).model), []
    for time in (step, -step, 0.0):
        kinematics = at(time)
        rows.fill(kinematics)
        rates.append(rows.memory.rows.jacobian @ kinematics.velocity)
    stated = rows.memory.rows.jacobian @ acceleration + rows.memory.rows.drift
    return float(np.abs(stated - (rates[0] - rates[1]) / (2.0 * step)).max())


def _along(
    robot: Robot,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    frames: Sequence[pin.Frame] = (),
) -> Callable[[float], Kinematics]:
    """Return the kinematics at time t of the motion with constant acceleration through a state."""

    def at(time: float) -> Kinematics:
        moved = time * velocity + 0.5 * time**2 * acceleration
        q = pin.integrate(robot.model, position, moved)
        kinematics = Kinematics(robot, frames)
        kinematics.update(q, velocity + time * acceleration)
        return kinematics

    return at
