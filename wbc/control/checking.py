"""What tasks and contacts say about their derivatives, held against differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.rows.contacts import Contact, ContactSet
from wbc.control.rows.tasks import Task
from wbc.robot import Robot

_STEP = 1e-5  # [s] of the differences


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
    robot: Robot, task: Task, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> DerivativeErrors:
    """Return how far a task's Jacobian and drift are from central differences.

    The error's rate is checked about its own present value, where it must be -J v; a task whose
    value is itself a rate (momentum) is checked by J v = value instead.

    Args:
        position, velocity, acceleration: (nq,), (nv,), (nv,) of the motion to go along.
    """
    task.check(robot)
    here, ahead, behind = states = _along(robot, (), position, velocity, acceleration)
    target, rate = task.value(here), task.jacobian(here) @ velocity
    if np.shape(target) == rate.shape and np.allclose(target, rate, rtol=1e-9, atol=1e-9):
        gone = -np.asarray(target)
    else:
        gone = (task.error(ahead, target) - task.error(behind, target)) / (2.0 * _STEP)
    rows = [(np.array(task.jacobian(k)), task.drift(k), k.velocity) for k in states]
    return DerivativeErrors(float(np.abs(gone + rate).max()), _drift_error(rows, acceleration))


def check_contact(
    robot: Robot,
    contact: Contact,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
) -> float:
    """Return how far J qdd + dJ/dt v of a contact is from the central difference of J v."""
    bound, rows = contact.bind(robot), []
    for kinematics in _along(robot, bound.frames, position, velocity, acceleration):
        contacts = ContactSet((bound,), kinematics.model)
        contacts.fill(kinematics)
        found = contacts.memory.rows
        rows.append((found.jacobian, found.drift, kinematics.velocity))
    return _drift_error(rows, acceleration)


def _drift_error(
    rows: Sequence[tuple[FloatArray, FloatArray, FloatArray]], acceleration: FloatArray
) -> float:
    """Return how far J qdd + dJ/dt v here is from the difference of J v ahead and behind."""
    (jacobian, drift, _), *others = rows
    ahead, behind = (one @ velocity for one, _, velocity in others)
    stated = jacobian @ acceleration + drift
    return float(np.abs(stated - (ahead - behind) / (2.0 * _STEP)).max())


def _along(
    robot: Robot, frames: Sequence[pin.Frame], q: FloatArray, v: FloatArray, a: FloatArray
) -> list[Kinematics]:
    """Return the kinematics at a state, and a step after and before it at constant acceleration."""
    found = [Kinematics(robot, frames) for _ in range(3)]
    for kinematics, time in zip(found, (0.0, _STEP, -_STEP), strict=True):
        place = pin.integrate(robot.model, q, time * v + 0.5 * time**2 * a)
        kinematics.update(place, v + time * a)
    return found
