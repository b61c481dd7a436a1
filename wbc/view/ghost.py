"""The model beside the measurement: where it would go under the torques that were measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import Workspace, evaluate
from wbc.identification.arguments import require_readable
from wbc.identification.model.residual import condensed_residual, raw_residual
from wbc.identification.records.preparation import prepare
from wbc.identification.records.record import Record
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.channels import configuration

TIE = 0.5
"""[s] time constant of the critically damped spring that ties the ghost to the measurement."""


@dataclass(frozen=True, eq=False)
class Ghost:
    """A model's answer to the torques of a log.

    The model is driven by the measured torques and ground forces and tied to the measured motion
    by a critically damped spring of 0.5 s, so that it never runs away: a right model lies on the
    measurement, a wrong one is pushed off it in the direction of its error.

    Attributes:
        label: what pages call it.
        time: (N,) [s].
        position: q (N, nq) of the model.
        residual_time: (rows,) [s].
        residual: joint -> (rows,) measured minus modelled torque, in noise floors.
    """

    label: str
    time: FloatArray
    position: FloatArray
    residual_time: FloatArray
    residual: Mapping[str, FloatArray]


def model_ghost(
    model: Robot, log: Log, floor: FloatArray | None = None, label: str = "model"
) -> Ghost:
    """Return the ghost of `model` on `log`.

    Args:
        model: the robot whose equations answer.
        log: motion, torques and, for a free base, contact forces.
        floor: (m + b,) root mean square that noise leaves in the residual, for example
            `Residuals.floor`; the level below which a tenth of it stays when left out.
        label: what pages call it.

    Raises:
        IdentificationError: a log that cannot be compared with the model.
        LogError: a channel is missing.
    """
    require_readable(model, log)
    record = prepare(model, [log])[0]
    residual = condensed_residual(model, [record])
    level = _quiet_level(residual) if floor is None else np.asarray(floor)
    joints = model.transmission.joints
    return Ghost(
        label=label,
        time=record.motion.time if record.motion.time is not None else log.time,
        position=_answer(model, record),
        residual_time=record.time,
        residual={name: residual[:, i] / level[i] for i, name in enumerate(joints)},
    )


def log_ghost(robot: Robot, log: Log, label: str) -> Ghost:
    """Return the motion of another run as a ghost, for example the one with ideal gears.

    Raises:
        LogError: the log holds no position of the robot.
    """
    return Ghost(label, log.time, configuration(robot, log), log.time[:1], {})


def _quiet_level(residual: FloatArray) -> FloatArray:
    size = np.abs(residual)
    return np.asarray(np.maximum(np.quantile(size, 0.1, axis=0), 1e-9 + 0.01 * size.max(axis=0)))


def _answer(model: Robot, record: Record) -> FloatArray:
    """Return q (N, nq): the measured motion plus the tied error of the model."""
    gears = model.transmission
    weighted = raw_residual(model, record) * record.weight
    torque = np.zeros((len(weighted), model.model.nv))
    torque[:, model.actuated] = np.linalg.solve(gears.topology.T, weighted[:, : gears.size].T).T
    torque[:, model.unactuated] = weighted[:, gears.size :]
    step = 1.0 / record.rate
    error, rate = np.zeros(model.model.nv), np.zeros(model.model.nv)
    position = np.empty(record.motion.position.shape)
    space = Workspace(model)
    for row, q in enumerate(record.motion.position):
        push = _acceleration(model, space, record, row, torque[row])
        # Implicit in the spring: stable at any rate of the log.
        rate = (rate + step * (push - error / TIE**2)) / (1.0 + 2.0 * step / TIE + step**2 / TIE**2)
        error = error + step * rate
        position[row] = pin.integrate(model.model, q, error)
    return position


def _acceleration(
    model: Robot, space: Workspace, record: Record, row: int, torque: FloatArray
) -> FloatArray:
    """Return what a torque (nv,) too much does, loaded contacts held in place."""
    terms = evaluate(model, record.motion.position[row], record.motion.velocity[row], space)
    gears = model.transmission
    inertia = terms.mass_matrix.copy()
    turn = gears.motor_from_joint
    inertia[np.ix_(model.actuated, model.actuated)] += (
        turn.T @ np.diag(gears.reflected_inertia) @ turn
    )
    loaded = [
        3 * i + axis
        for i, contact in enumerate(model.contacts)
        for axis in range(3)
        if np.abs(record.forces.get(contact.name, np.zeros((row + 1, 3)))[row]).max() > 1.0
    ]
    free = np.linalg.solve(inertia, torque)
    if not loaded:
        return np.asarray(free)
    jacobian = terms.contact_jacobian[loaded]
    response = np.linalg.solve(inertia, jacobian.T)
    return np.asarray(free - response @ np.linalg.pinv(jacobian @ response) @ (jacobian @ free))
