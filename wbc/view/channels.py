"""What pages and pictures need from a log; unlike an estimate they make do with what is there.

First channels; then what a playback shows at each of its frames, and a model's answer to a log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.signal import lfilter

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import Workspace, evaluate, link_torque, rotor_torque as needed_torque
from wbc.errors import LogError, ViewError
from wbc.identification.choice.candidate_columns import evidence
from wbc.identification.model.residual import condensed_residual
from wbc.identification.readings.checks import require_readable
from wbc.identification.records.channels import contact_forces, positions, velocities
from wbc.identification.records.drives import reported_share, torque_sources
from wbc.identification.records.preparation import prepare
from wbc.identification.records.record import Record
from wbc.measurement import Log
from wbc.measurement.checks import true_runs
from wbc.measurement.schema import REPORTED
from wbc.robot import Motion, Robot
from wbc.tables import few
from wbc.transmission import Transmission, direction


def configuration(robot: Robot, log: Log) -> FloatArray:
    """Return q (N, nq); a joint that the log does not mention stays at its neutral position.

    Where only a velocity was recorded its integral stands for the position.

    Raises:
        LogError: the log holds the position of no joint of the robot.
    """
    told = [log.has(f"{n}.position") or log.has(f"{n}.velocity") for n in robot.single_joints]
    if not any(told) and not (robot.has_free_flyer and log.has("base.position.x")):
        names = few([f"{joint}.position" for joint in robot.single_joints], 4)
        place = f"{log.source.label}: no position of any joint of '{robot.name}'"
        raise LogError(f"{place}; expected {names}.")
    return positions(robot, log, partial=True)


def velocity(robot: Robot, log: Log) -> FloatArray:
    """Return v (N, nv): measured where the log has it, else the difference of the positions."""
    return velocities(robot, log, partial=True)


def rotor_torque(robot: Robot, log: Log) -> FloatArray:
    """Return the torque on the rotors (N, m) [N m]; NaN columns where the log holds none."""
    gears = robot.transmission
    torque = np.full((len(log), gears.size), np.nan)
    for k, (joint, source) in enumerate(zip(gears.joints, torque_sources(log, gears), strict=True)):
        if source in REPORTED:
            torque[:, k] = log.column(f"{joint}.{source}") * reported_share(gears, k, source)
    return torque


def kinematics(robot: Robot, position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where everything is at N positions, in the world.

    Args:
        robot: of which.
        position: q (N, nq).

    Returns:
        Placement of every joint frame as x, y, z and quaternion x, y, z, w (N, joints, 7), row 0 is
        the world; centre of mass (N, 3) [m]; contact points (N, contacts, 3) [m].
    """
    space = Workspace(robot)
    model, data, rows = space.model, space.data, len(position)
    poses, points = np.empty((rows, model.njoints, 7)), np.empty((rows, len(space.frames), 3))
    center = np.empty((rows, 3))
    for row, q in enumerate(position):
        center[row] = pin.centerOfMass(model, data, q)
        poses[row] = [pin.SE3ToXYZQUAT(place) for place in data.oMi]
        for i, frame in enumerate(space.frames):
            points[row, i] = pin.updateFramePlacement(model, data, frame).translation
    return poses, center, points


def base_pitch(robot: Robot, poses: FloatArray) -> FloatArray:
    """Return the rotation (N,) [rad] about +y of the body that the last undriven joint carries.

    Args:
        robot: of which.
        poses: (N, joints, 7) of `kinematics`.
    """
    if not robot.unactuated.size:
        return np.zeros(len(poses))
    number = np.searchsorted(robot.model.idx_vs[1:], robot.unactuated[-1], side="right")
    x, y, z, w = poses[:, number, 3:].T
    return np.asarray(np.arctan2(2.0 * (x * z + y * w), 1.0 - 2.0 * (y**2 + z**2)))


_QUIET = 0.02
_MOMENT = 0.02


@dataclass(frozen=True)
class RecordedImpact:
    """A contact that closes on a moving robot.

    Attributes:
        time: [s].
        contact: its name.
        force: [N] largest force within 20 ms.
    """

    time: float
    contact: str
    force: float


def find_impacts(
    time: FloatArray, forces: Mapping[str, FloatArray], weight: float
) -> tuple[RecordedImpact, ...]:
    """Return the instants at which a contact force rises out of the air.

    A contact that was in the air for 20 ms (force below a fiftieth of the weight) has hit the
    ground when it bears its even share of the weight within another 20 ms.

    Args:
        time: (N,) [s].
        forces: contact name -> (N, 3) [N].
        weight: [N] of the robot.
    """
    impacts = []
    for name, force in forces.items():
        size = np.linalg.norm(force, axis=1)
        for left, row in zip(*true_runs(size < _QUIET * weight), strict=True):  # in the air
            if row == len(time) or time[row] - time[left] < _MOMENT:
                continue
            soon = size[row : int(np.searchsorted(time, time[row] + _MOMENT)) + 1]
            if soon.max() >= weight / len(forces):
                impacts.append(RecordedImpact(float(time[row]), name, float(soon.max())))
    return tuple(sorted(impacts, key=lambda impact: impact.time))


def log_impacts(robot: Robot, log: Log) -> tuple[RecordedImpact, ...]:
    """Return the impacts that the contact forces of a log show."""
    return find_impacts(log.time, contact_forces(robot, log), robot.weight)


_NEAR = 3


def jump_rows(values: FloatArray, near: Sequence[int]) -> tuple[int, ...]:
    """Return the first row after the largest jump of `values` around each of some rows.

    A recording that gives force and speed of the same step and one that samples them at the same
    instant put the jump of the speeds on different rows; three rows either way are searched.

    Args:
        values: (N, k).
        near: rows at which something hit.
    """
    steps = np.abs(np.diff(values, axis=0)).max(axis=1, initial=0.0)
    spans = [slice(max(row - _NEAR, 0), row + _NEAR) for row in near]
    found = {one.start + int(np.argmax(steps[one])) + 1 for one in spans if steps[one].size}
    return tuple(sorted(found))


def window_mean(values: FloatArray, rows: int, jumps: Sequence[int] = ()) -> FloatArray:
    """Return the mean of `values` (N, ...) over `rows` rows around each, never across a jump.

    Towards an end or a jump the window shrinks on both sides, so that a ramp stays a ramp.
    """

    def mean(piece: FloatArray) -> FloatArray:
        row = np.arange(len(piece))
        reach = np.minimum(rows // 2, np.minimum(row, row[::-1]))
        sums = np.concatenate([np.zeros_like(piece[:1]), np.cumsum(piece, axis=0)])
        return np.asarray(((sums[row + reach + 1] - sums[row - reach]).T / (2 * reach + 1)).T)

    return np.concatenate([mean(piece) for piece in np.split(values, jumps)])


def rate_of_change(values: FloatArray, time: FloatArray, jumps: Sequence[int]) -> FloatArray:
    """Return d/dt of `values` (N, ...) between jumps; 0 in a piece of a single row."""
    pieces = zip(np.split(values, jumps), np.split(time, jumps), strict=True)
    rates = [np.gradient(v, t, axis=0) if len(t) > 1 else np.zeros_like(v) for v, t in pieces]
    return np.concatenate(rates)


STILL_SPEED = 0.02
"""[rad/s] below which a picture calls a gear stuck: several times an encoder's noise."""

_IDLE_SHARE = 0.005


@dataclass(frozen=True, eq=False)
class GearFlow:
    """Torque and power of every gear along a log; NaN where the log holds no torque.

    All but `rotor_torque` are averaged over 20 ms, never across an impact, at which speeds jump.

    Attributes:
        rotor_torque: tau_phi (N, m) [N m] on the rotors, as logged.
        speed: dpsi (N, m) [rad/s] at the motor outputs.
        mesh_power: t dpsi (N, m) [W], what enters the teeth after the rotor's own inertia and
            friction are paid; positive where the motor drives.
        loss: (N, m) [W] >= 0, turned into heat by rotor friction and teeth.
        direction: (N, m) of +1 forward, -1 backward, 0 stuck or idle (below 0.5 % of the largest
            power in the log).
    """

    rotor_torque: FloatArray
    speed: FloatArray
    mesh_power: FloatArray
    loss: FloatArray
    direction: FloatArray


def gear_flow(robot: Robot, log: Log, window: float = 0.02) -> GearFlow:
    """Return the power through the gears of `robot` along `log`.

    Good enough for a picture; the average is no estimate to identify with.

    Args:
        robot: whose gears and rotors.
        log: positions or velocities, and torques.
        window: [s] to average over.
    """
    gears = robot.transmission
    torque = rotor_torque(robot, log)
    raw = velocity(robot, log)[:, robot.actuated] @ gears.motor_from_joint.T
    hits = [int(np.searchsorted(log.time, impact.time)) for impact in log_impacts(robot, log)]
    jumps = jump_rows(raw, hits)
    width = round(window / log.sample_time)
    speed = window_mean(raw, width, jumps)
    acceleration = rate_of_change(speed, log.time, jumps)
    mesh, loss = gear_powers(gears, torque, speed, acceleration)
    # The mean of the losses, not the loss of the mean: torque that shakes a gear costs heat too.
    loss, power = window_mean(loss, width, jumps), window_mean(mesh, width, jumps)
    largest = float(np.nanmax(np.abs(power))) if np.isfinite(power).any() else 0.0
    moving = direction(power, deadband=_IDLE_SHARE * largest)
    towards = np.where(np.abs(speed) < STILL_SPEED, 0.0, moving)
    return GearFlow(torque, speed, power, loss, towards)


def gear_powers(
    gears: Transmission, torque: FloatArray, speed: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mesh input power and the loss of every gear, both (..., m) [W].

    Args:
        gears: m of them.
        torque: tau_phi (..., m) [N m] on the rotors.
        speed: dpsi (..., m) [rad/s] at the motor outputs.
        acceleration: (..., m) [rad/s^2] of them.
    """
    spin = gears.gear_ratio * speed
    friction = gears.rotor_coulomb_friction * np.sign(spin) + gears.rotor_viscous_friction * spin
    mesh = gears.gear_ratio * (torque - friction) - gears.reflected_inertia * acceleration
    return mesh * speed, tooth_loss(gears, mesh * speed) + friction * spin


def tooth_loss(gears: Transmission, mesh_power: FloatArray) -> FloatArray:
    """Return what the teeth turn into heat (..., m) [W] at a mesh input power (..., m).

    Forward the output gets eta_f of the input; backward the input gets eta_b of what the joint
    gives, so the joint gives P/eta_b. A self-locking gear that is pushed backward takes nothing
    through its teeth: all power that the motor still absorbs comes out of measurement error, and
    none is counted.
    """
    share = 1.0 / np.where(gears.backward_efficiency > 0.0, gears.backward_efficiency, 1.0) - 1.0
    forward = (1.0 - gears.forward_efficiency) * np.maximum(mesh_power, 0.0)
    return np.asarray(forward + share * np.maximum(-mesh_power, 0.0))


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
    shown = {name: residual[:, i] / floor[i] for i, name in enumerate(joints)}
    time = np.asarray(record.motion.time)
    return Ghost(label, time, _answer(model, record), record.time, shown)


def _answer(model: Robot, record: Record) -> FloatArray:
    """Return q (N, nq): the measured motion plus the tied error of the model."""
    gears, driven, motion = model.transmission, model.actuated, record.motion
    torque = np.array(evidence(model, [record]).unexplained[0])
    torque[:, driven] = np.linalg.solve(gears.topology.T, torque[:, driven].T).T
    rotors = gears.motor_from_joint.T * gears.reflected_inertia @ gears.motor_from_joint
    forces = [record.forces.get(one.name, np.zeros((len(torque), 3))) for one in model.contacts]
    largest = np.abs(np.array(forces).reshape(-1, len(torque), 3)).max(axis=2)
    bears = np.repeat(largest > 1.0, 3, axis=0)
    space, push = Workspace(model), np.empty(torque.shape)
    for row, q in enumerate(motion.position):
        # What the torque too much does, loaded contacts held in place.
        terms = evaluate(model, q, motion.velocity[row], space)
        inertia, held = terms.mass_matrix.copy(), terms.contact_jacobian[bears[:, row]]
        inertia[np.ix_(driven, driven)] += rotors
        equations = np.block([[inertia, held.T], [held, np.zeros((len(held), len(held)))]])
        asked = np.append(torque[row], np.zeros(len(held)))
        push[row] = np.linalg.lstsq(equations, asked, rcond=None)[0][: model.model.nv]
    # Implicit in the spring: stable at any rate of the log.
    step = 1.0 / (record.rate * TIE)
    slow = (1.0 + step) ** 2
    memory = [1.0, -1.0 - (1.0 - step**2) / slow, 1.0 / slow]
    error = lfilter([(step * TIE) ** 2 / slow], memory, push, axis=0)
    pairs = zip(motion.position, error, strict=True)
    return np.array([pin.integrate(model.model, q, moved) for q, moved in pairs])


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
    wanted = min(len(log), _MAX_FRAMES, int(log.duration * _FRAME_RATE) + 1)
    instants = np.linspace(log.time[0], log.time[-1], max(wanted, 2))
    rows = np.unique(np.searchsorted(log.time, instants - 0.5 * log.sample_time))
    poses, center, points = kinematics(robot, configuration(robot, log)[rows])
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
    motion, joints = ("position", "velocity", "acceleration"), robot.transmission.joints
    told = log.has(*(f"{joint}.{what}" for joint in joints for what in motion))
    return told and not (robot.floating_size or np.isfinite(rotor_torque(robot, log)).any())


def with_needed_torques(robot: Robot, log: Log) -> Log:
    """Return a planned motion with the rotor torques that the model needs for it."""
    joints, acceleration = robot.transmission.joints, np.zeros((len(log), robot.model.nv))
    acceleration[:, robot.actuated] = log.stack("acceleration", joints)
    motion = Motion(configuration(robot, log), velocity(robot, log), acceleration, log.time)
    torque, _ = needed_torque(robot, motion, link_torque(robot, motion))
    names = (f"{joint}.rotor_torque" for joint in joints)
    return log.with_columns(dict(zip(names, torque.T, strict=True)))


def _largest(force: FloatArray, rows: IntArray) -> FloatArray:
    """Return for each frame the force of the largest size since the frame before."""
    size, starts = np.linalg.norm(force, axis=1), [0, *(rows[:-1] + 1)]
    return force[[a + np.argmax(size[a : b + 1]) for a, b in zip(starts, rows, strict=True)]]


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
    rows = np.rint(np.interp(time, ghost.time, np.arange(len(ghost.time)))).astype(np.int_)
    own = ghost.residual.items()
    residual = {joint: np.interp(time, ghost.residual_time, values) for joint, values in own}
    return kinematics(robot, ghost.position[rows])[0], residual
