"""What a log says of a robot: motion, forces and torques, on an even clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import pinocchio as pin
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import FloatArray, frozen
from wbc.dynamics.batch import inertial_parameters, point_jacobians
from wbc.errors import LogError
from wbc.files import as_json
from wbc.identification.records.contacts import active_contacts
from wbc.identification.records.drives import drive_torques, tells_torque, torque_sources
from wbc.identification.records.record import Record
from wbc.measurement.log import OF_THE_DRIVE, Log, Machine
from wbc.measurement.schema import FREE_POSE, FREE_VELOCITY
from wbc.robot import Motion, Robot
from wbc.transmission import DRIVE_TIMES, Transmission

_EARLY = 0.1  # of a sample; 20 us of jitter in stamps 4 ms apart are 0.005
_EVEN = 1e-3  # time stamps that stray less than this share of a step count as even
_STATES = 4  # drawn at random; one that does not show a dependence has measure zero
_SAME = 1e-9  # of the torque, what rounding makes


def without_position(robot: Robot, log: Log) -> tuple[str, ...]:
    """Return the joints whose velocity a log holds and whose position it lacks."""
    return tuple(
        joint
        for joint in robot.single_joints
        if log.has(f"{joint}.velocity") and not log.recorded(f"{joint}.position")
    )


def placeless_joints(robot: Robot, joints: Sequence[str]) -> tuple[str, ...]:
    """Return those of `joints` whose position changes neither what the links need nor a contact.

    Such are the shaft of a motor on a test bench and a flywheel: nothing hangs on them that gravity
    could turn, and their inertia is the same at every angle.
    """
    model, data, random = robot.model, robot.model.createData(), np.random.default_rng(0)
    felt = np.zeros(model.nv, dtype=bool)
    for _ in range(_STATES):
        turn, v, a = random.standard_normal((3, model.nv))
        q = pin.integrate(model, robot.neutral(), turn)
        slopes = [pin.computeRNEADerivatives(model, data, q, v, a)[0]]
        slopes += [point_jacobians(robot, q[None], c.name)[0, :3] for c in robot.contacts]
        size = max(1.0, float(np.abs(data.tau).max()))
        felt |= np.abs(np.concatenate(slopes)).max(axis=0) > _SAME * size
    return tuple(joint for joint in joints if not felt[robot.velocity_index(joint)])


def with_machine(log: Log, robot: Robot, own: Robot) -> Log:
    """Return a log of `own`, a machine that differs from `robot` in its drives or its loads.

    Raises:
        LogError: it differs in something else, which all logs have to share.
    """
    gears = [as_json(one.transmission, "unlimited") for one in (own, robot)]
    shared = (field.name for field in fields(Transmission) if field.name not in OF_THE_DRIVE)
    different = [name for name in shared if gears[0][name] != gears[1][name]]
    one, other = own.model, robot.model
    places = zip(one.jointPlacements, other.jointPlacements, strict=False)
    same = list(one.names) == list(other.names) and all(a.isApprox(b) for a, b in places)
    if not same or not np.array_equal(one.gravity.linear, other.gravity.linear):
        different.append("joints or gravity")
    known = {(*e.key, *e.values.items()) for e in robot.effects}
    beside = [e for e in own.effects if "change" not in e.acts_by]
    different += [
        f"{e.name} at {e.where}" for e in beside if (*e.key, *e.values.items()) not in known
    ]
    if different:
        raise LogError(
            f"{log.source.label}: its robot '{own.name}' differs from '{robot.name}' in "
            f"{', '.join(different)}. The robots of logs that are judged together may differ in "
            "gains, supply voltage and torque limit of the drives and in the inertia of the links."
        )
    inertia = inertial_parameters(own) - inertial_parameters(robot)
    return replace(log, machine=Machine(own.transmission, frozen(inertia)))


def positions(robot: Robot, log: Log, *, partial: bool = False) -> FloatArray:
    """Return q (N, nq); the integral of a velocity stands for a position that was not measured.

    Args:
        robot: whose joints.
        log: with their positions, and the poses of a free base and of free bodies.
        partial: what the log lacks stays neutral.

    Raises:
        LogError: it lacks the position of a joint, or the pose of a free base or body.
    """
    position, alone = np.tile(robot.neutral(), (len(log), 1)), without_position(robot, log)
    for name in robot.single_joints:
        own, speed = f"{name}.position", f"{name}.velocity"
        if name in alone:
            turned = cumulative_trapezoid(log.column(speed), log.time, initial=0.0)
            position[:, robot.position_index(name)] = turned
        elif not partial or log.has(own) or log.has(speed):
            position[:, robot.position_index(name)] = log.column(own)
    for owner, (at, _) in robot.free_flyers.items():
        names = [f"{owner}.{quantity}" for quantity in FREE_POSE]
        if not partial or log.has(*names):
            pose = np.stack([log.column(name) for name in names], axis=1)
            pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
            position[:, at : at + 7] = pose
    return position


def velocities(robot: Robot, log: Log, *, partial: bool = False) -> FloatArray:
    """Return v (N, nv), all of it NaN if one was not measured.

    Args:
        robot: whose joints.
        log: with their velocities, and those of a free base and of free bodies.
        partial: the difference of the positions stands for what was not measured, then zero.
    """
    velocity = np.zeros((len(log), robot.model.nv))
    for name in robot.single_joints:
        row = robot.velocity_index(name)
        if log.has(f"{name}.velocity"):
            velocity[:, row] = log.column(f"{name}.velocity")
        elif not partial:
            return np.full_like(velocity, np.nan)
        elif log.has(f"{name}.position"):
            velocity[:, row] = np.gradient(log.column(f"{name}.position"), log.time)
    for owner, (_, at) in robot.free_flyers.items():
        names = [f"{owner}.{quantity}" for quantity in FREE_VELOCITY]
        if log.has(*names):
            velocity[:, at : at + 6] = np.stack([log.column(name) for name in names], axis=1)
        elif not partial:
            return np.full_like(velocity, np.nan)
    return velocity


def contact_forces(robot: Robot, log: Log) -> dict[str, FloatArray]:
    """Return contact name -> force of the ground on the robot (N, 3) [N], world axes.

    An axis that the log lacks is zero; a contact of which it holds no axis is left out.
    """
    zero, measured = np.zeros(len(log)), log.contacts
    return {
        name: np.stack([log.columns.get(f"{name}.force.{axis}", zero) for axis in "xyz"], axis=1)
        for name in (contact.name for contact in robot.contacts)
        if name in measured
    }


def read_channels(robot: Robot, log: Log, step: float | None = None) -> Record:
    """Return what a log that `require_readable` let pass says about `robot`.

    Args:
        robot: that the log is held against.
        log: the log.
        step: of the even clock [s]; that of the log when left out.

    Raises:
        LogError: the torque of a driven joint or the position of a joint is missing.
        IdentificationError: a free base without forces.
    """
    step = step or log.sample_time
    # A last stamp that is early by its jitter takes no sample away.
    count = int(np.floor(log.duration / step + _EARLY)) + 1
    grid = log.time[0] + step * np.arange(count)
    even = count == len(log) and np.abs(log.time - grid).max() < _EVEN * step

    def on_grid(values: FloatArray) -> FloatArray:
        if even:
            return values
        columns = np.array([np.interp(grid, log.time, column) for column in values.T])
        return np.ascontiguousarray(columns.reshape(-1, count).T)

    def optional(quantity: str) -> FloatArray | None:
        joints = robot.transmission.joints
        known = log.has(*(f"{joint}.{quantity}" for joint in joints))
        return on_grid(log.stack(quantity, joints)) if known else None

    position, velocity = on_grid(positions(robot, log)), on_grid(velocities(robot, log))
    gears, sensors = robot.transmission, robot.torque_sensors
    sources = torque_sources(log, gears)
    if log.machine is not None:
        times = {name: getattr(gears, name) for name in DRIVE_TIMES}
        gears = log.machine.transmission.replace(**times)
    # A drive that says nothing is known to be silent where only a sensor behind its gear reports.
    unsensed = np.array([joint not in sensors for joint in gears.joints])
    reported = tells_torque(log, gears) | unsensed
    silent = [joint for joint, yes in zip(gears.joints, reported, strict=True) if not yes]
    told = log.with_columns({f"{joint}.rotor_torque": np.zeros(len(log)) for joint in silent})
    torque, feedback = drive_torques(told, gears)
    motion = Motion(
        position,
        velocity,
        time=grid - grid[0],
        temperature=optional("temperature"),
        supply_voltage=optional("voltage"),
        feedback_torque=on_grid(feedback) if feedback.any() else None,
    )
    return Record(
        name=log.source.label,
        robot=robot,
        motion=motion,
        torque=on_grid(torque),
        reported=frozen(reported, np.bool_),
        currents=frozen((np.array(sources) == "current") & reported, np.bool_),
        sensed=on_grid(log.stack("joint_torque", sensors)),
        forces={name: on_grid(force) for name, force in contact_forces(robot, log).items()},
        active=active_contacts(robot, log, grid, position),
        rate=1.0 / step,
        inertia=None if log.machine is None else log.machine.inertia,
        placeless=() if np.isnan(velocity).any() else without_position(robot, log),
    )


def typical_inertia(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return the inertia (m,) of each driven joint with its rotor, over some places of logs."""
    found = []
    for record in records:
        model, position = record.model_of(robot), record.motion.position
        data = model.createData()
        for q in position[:: max(1, len(position) // 10)]:
            found.append(np.diag(pin.crba(model, data, q))[robot.actuated])
    return np.asarray(np.mean(found, axis=0) + robot.transmission.reflected_inertia)
