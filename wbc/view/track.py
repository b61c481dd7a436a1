"""A recording brought to the frames of a playback."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import Workspace, evaluate, link_torque, rotor_torque as needed_torque
from wbc.errors import ViewError
from wbc.identification.choice.candidate_columns import evidence
from wbc.identification.model.residual import condensed_residual
from wbc.identification.readings.checks import require_readable
from wbc.identification.records.channels import contact_forces
from wbc.identification.records.preparation import prepare
from wbc.identification.records.record import Record
from wbc.measurement import Log
from wbc.robot import Motion, Robot
from wbc.view.channels import (
    RecordedImpact,
    configuration,
    find_impacts,
    gear_flow,
    kinematics,
    rotor_torque,
    velocity,
)

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
    if floor is None:
        size = np.abs(residual)
        floor = np.maximum(np.quantile(size, 0.1, axis=0), 1e-9 + 0.01 * size.max(axis=0))
    joints = model.transmission.joints
    return Ghost(
        label=label,
        time=np.asarray(record.motion.time),
        position=_answer(model, record),
        residual_time=record.time,
        residual={name: residual[:, i] / floor[i] for i, name in enumerate(joints)},
    )


def _answer(model: Robot, record: Record) -> FloatArray:
    """Return q (N, nq): the measured motion plus the tied error of the model."""
    topology, driven = model.transmission.topology, model.actuated
    torque = np.array(evidence(model, [record]).unexplained[0])
    torque[:, driven] = np.linalg.solve(topology.T, torque[:, driven].T).T
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
    inertia, gears = terms.mass_matrix.copy(), model.transmission
    rotors = gears.motor_from_joint.T * gears.reflected_inertia @ gears.motor_from_joint
    inertia[np.ix_(model.actuated, model.actuated)] += rotors
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


_FRAME_RATE = 60.0
_MAX_FRAMES = 3600


@dataclass(frozen=True, eq=False)
class Track:
    """Everything that a playback shows, at its frames.

    Attributes:
        time: (F,) [s] on the log's clock.
        poses: (F, joints, 7), world placement of every joint frame as x, y, z and quaternion
            x, y, z, w; row 0 is the world.
        center_of_mass: (F, 3) [m].
        points: contact name -> (F, 3) [m], world.
        forces: the same of those that bear force in the log -> (F, 3) [N], ground on robot; the
            largest since the last frame, so that an impact is not skipped.
        torque: (F, m) [N m] at the motor outputs, N tau_phi; NaN where the log holds none.
        power: (F, m) [W] mesh power, NaN likewise.
        direction: (F, m) of +1, 0, -1.
        impacts: instants at which a contact force jumps.
        planned: whether it is a planned motion.
    """

    time: FloatArray
    poses: FloatArray
    center_of_mass: FloatArray
    points: Mapping[str, FloatArray]
    forces: Mapping[str, FloatArray]
    torque: FloatArray
    power: FloatArray
    direction: FloatArray
    impacts: tuple[RecordedImpact, ...]
    planned: bool


def make_track(robot: Robot, log: Log) -> Track:
    """Return what a playback of `log` shows, at up to 60 frames per second (3600 in all).

    A planned motion gets the torques that the model needs for it.

    Raises:
        LogError: the log holds no position of the robot.
    """
    planned = is_planned(robot, log)
    log = with_needed_torques(robot, log) if planned else log
    rows = frame_rows(log)
    position = configuration(robot, log)[rows]
    poses, center, points = kinematics(robot, position)
    forces, flow = contact_forces(robot, log), gear_flow(robot, log)
    return Track(
        time=log.time[rows],
        poses=poses,
        center_of_mass=center,
        points={contact.name: points[:, i] for i, contact in enumerate(robot.contacts)},
        forces={name: _largest(force, rows) for name, force in forces.items() if np.any(force)},
        torque=(flow.rotor_torque * robot.transmission.gear_ratio)[rows],
        power=flow.mesh_power[rows],
        direction=flow.direction[rows],
        impacts=find_impacts(log.time, forces, robot.weight),
        planned=planned,
    )


def is_planned(robot: Robot, log: Log) -> bool:
    """Return whether a log holds set points: the motion with its acceleration, and no torque."""
    motion = ("position", "velocity", "acceleration")
    joints = robot.transmission.joints
    return (
        robot.floating_size == 0
        and log.has(*(f"{joint}.{what}" for joint in joints for what in motion))
        and not np.isfinite(rotor_torque(robot, log)).any()
    )


def with_needed_torques(robot: Robot, log: Log) -> Log:
    """Return a planned motion with the rotor torques that the model needs for it."""
    joints, acceleration = robot.transmission.joints, np.zeros((len(log), robot.model.nv))
    acceleration[:, robot.actuated] = log.stack("acceleration", joints)
    motion = Motion(configuration(robot, log), velocity(robot, log), acceleration, log.time)
    torque, _ = needed_torque(robot, motion, link_torque(robot, motion))
    names = (f"{joint}.rotor_torque" for joint in joints)
    return log.with_columns(dict(zip(names, torque.T, strict=True)))


def frame_rows(log: Log) -> FloatArray:
    """Return the row of the log that each frame shows, (F,) int."""
    wanted = min(len(log), _MAX_FRAMES, int(log.duration * _FRAME_RATE) + 1)
    instants = np.linspace(log.time[0], log.time[-1], max(wanted, 2))
    rows = np.searchsorted(log.time, instants - 0.5 * log.sample_time)
    return np.unique(np.clip(rows, 0, len(log) - 1))


def _largest(force: FloatArray, rows: FloatArray) -> FloatArray:
    """Return for each frame the force of the largest size since the frame before."""
    size = np.linalg.norm(force, axis=1)
    starts = np.concatenate([[0], rows[:-1] + 1])
    picks = [int(a + np.argmax(size[a : b + 1])) for a, b in zip(starts, rows, strict=True)]
    return np.asarray(force[picks])


def ghost_at(
    robot: Robot, ghost: Ghost, time: FloatArray
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return poses (F, joints, 7), as `Track.poses`, and residuals (F,) of a ghost at frame times.

    The nearest sample is shown.

    Raises:
        ViewError: the ghost is of another robot.
    """
    if ghost.position.shape[1] != robot.model.nq:
        raise ViewError(f"the ghost '{ghost.label}' has other joints than '{robot.name}'.")
    later = np.clip(np.searchsorted(ghost.time, time), 1, len(ghost.time) - 1)
    rows = np.where(time - ghost.time[later - 1] < ghost.time[later] - time, later - 1, later)
    residual = {
        joint: np.interp(time, ghost.residual_time, values)
        for joint, values in ghost.residual.items()
    }
    return kinematics(robot, ghost.position[rows])[0], residual
