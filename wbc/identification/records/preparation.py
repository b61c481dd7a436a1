"""From logs to records: one band for all of them, smoothing, weights near reversals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.errors import IdentificationError
from wbc.identification.records import filters
from wbc.identification.records.channels import read_channels, typical_inertia
from wbc.identification.records.filters import Bandwidth, NoiseDensity, low_passed, white_level
from wbc.identification.records.noise import load_bands, synthetic_noise
from wbc.identification.records.not_judged import not_judged_at_rest
from wbc.identification.records.record import Record, at_outputs, rms, rubbing
from wbc.measurement import Log, derivative, differentiate, low_pass
from wbc.robot import Motion, Robot

_JITTER = 0.01  # of a sample, by which logs of one rate may differ
_PATH = 0.05  # of the rate: below this a base moves, far below where its noise is read
_OVERSAMPLING = 6.0  # samples kept per period of the kinematic band
_SHARED_NOISE = 0.5
# Share of a position's noise by which it differs from the integral of the velocity: 1e-11 and less
# of three positions that were integrated, 0.5 and more of five recorded encoders.
_SAME = 1e-3
_REST = 3.0  # standard deviations of its noise, up to which a speed is none
_UNSETTLED = 2.0  # periods of the kinematic band at both ends of a log
_JUMP = 0.3  # of the robot's weight, by which a force may change from one sample to the next
_REACH = 2.0  # periods of the kinematic band on both sides, over which the filters carry a jump
_MOST = 0.5  # of a log that may be set aside
REVERSAL = 0.8  # width of the weight around a reversal, in periods of the kinematic band


def prepare(robot: Robot, logs: Sequence[Log], reversal: float = REVERSAL) -> tuple[Record, ...]:
    """Return one record per log, all in the same band.

    Args:
        robot: that the logs are held against.
        logs: at least one.
        reversal: how long around a change of direction a joint counts for nothing, in periods of
            the kinematic band. A narrow one shows what acts at low speed only, and the moments at
            which large dry friction is smoothed wrongly.

    Raises:
        IdentificationError: no log, or a log that lacks what the robot needs.
        LogError: a channel is missing.
    """
    if not logs:
        raise IdentificationError("no log was given.")
    # Repeated runs are compared at the same time: the usual distance of stamps that are rounded or
    # jitter is off, by 1.5e-4 in one of two runs of 20 s that were 3 ms apart at their end.
    usual = float(np.median([log.sample_time for log in logs]))
    alike = [abs(log.sample_time - usual) < _JITTER * usual for log in logs]
    steps = [usual if same else None for same in alike]
    read = [read_channels(robot, *pair) for pair in zip(logs, steps, strict=True)]
    noises = [_noise(record) for record in read]
    rate = min(record.rate for record in read)
    band = filters.choose_bandwidth(noises, typical_inertia(robot, read), robot.actuated, rate)
    pairs = zip(read, noises, strict=True)
    records = [_smooth(record, noise, band, reversal) for record, noise in pairs]
    return tuple(_with_noise_shared(record) for record in not_judged_at_rest(records))


def _noise(read: Record) -> NoiseDensity:
    robot, rate, motion, torque = read.robot, read.rate, read.motion, _motor_torque(read)
    positions = np.full_like(motion.velocity, np.nan)
    for name in set(robot.single_joints) - set(read.placeless):
        positions[:, robot.velocity_index(name)] = motion.position[:, robot.position_index(name)]
    if robot.has_free_flyer:
        # How far the measured base strays from a smooth path, in its own frame.
        path = filters.smoothed(robot, motion.position, _PATH * rate, rate)
        pairs = zip(path, motion.position, strict=True)
        positions[:, :6] = [pin.difference(robot.model, *pair)[:6] for pair in pairs]
    # The integral of a velocity is no measurement. Its noise is a random walk: read as white it
    # would make a motor that stands still move.
    walked = positions - cumulative_trapezoid(motion.velocity, dx=1.0 / rate, axis=0, initial=0.0)
    made = white_level(walked, rate) < _SAME * white_level(positions, rate)
    positions[:, made] = np.nan
    passed, density = low_passed(torque, rate)
    steps = filters.quantisation_level(positions, rate)
    return NoiseDensity(
        # NaN, where no position was measured, stays NaN.
        position=np.maximum(white_level(positions, rate), steps),
        velocity=white_level(motion.velocity, rate),
        torque=np.maximum(white_level(torque, rate), density),
        forces={name: white_level(force, rate) for name, force in read.forces.items()},
        sensed=np.maximum(white_level(read.sensed, rate), low_passed(read.sensed, rate)[1]),
        passed=passed,
    )


def _smooth(read: Record, noise: NoiseDensity, band: Bandwidth, reversal: float) -> Record:
    """Return a record in the band of the kinematics, with weights."""
    robot, every = read.robot, max(1, int(read.rate / (_OVERSAMPLING * band.kinematics)))
    motion = _smooth_motion(read, noise, band)
    noise = _while_turning_one_way(read, noise, motion)
    known = {name: own for name, own in vars(motion).items() if own is not None}
    motion = motion.replace(**{name: frozen(own[::every]) for name, own in known.items()})

    def smooth(values: FloatArray) -> FloatArray:
        return frozen(low_pass(values, band.kinematics, read.rate)[::every])

    away = away_from_impacts(read, band)[::every, None]
    return replace(
        read,
        motion=motion,
        torque=smooth(read.torque),
        sensed=smooth(read.sensed),
        forces={name: smooth(force) for name, force in read.forces.items()},
        active={name: touches[::every] for name, touches in read.active.items()},
        weight=frozen(_weight(robot, motion, noise, band, reversal) * away),
        rate=read.rate / every,
        bandwidth=band,
        noise=noise,
    )


def _with_noise_shared(record: Record) -> Record:
    """Return the record with weights shared by outputs that share their noise.

    A joint whose noise is mostly that of the base can only be judged together with the base, at
    the same moments. Loads are believed as far as they are more than noise.
    """
    reported, needed = synthetic_noise(record)
    cutoff = record.bandwidth.residual
    reported = low_pass(reported, cutoff, record.rate)
    noise = reported + low_pass(needed, cutoff, record.rate)
    moments = noise.T @ noise / len(noise)
    size = np.sqrt(np.maximum(np.diag(moments), 1e-300))
    partners = np.abs(moments / np.outer(size, size)) > _SHARED_NOISE
    partners &= record.weight.any(axis=0)  # one that is not judged here speaks for no other
    np.fill_diagonal(partners, True)
    weight = np.stack([record.weight[:, row].min(axis=1) for row in partners], axis=1)
    return replace(record, weight=frozen(weight), load_band=frozen(load_bands(record, needed)))


def _smooth_motion(read: Record, noise: NoiseDensity, band: Bandwidth) -> Motion:
    """Return smoothed q, v, a; each joint from the sensor that gives the quieter acceleration."""
    rate, cutoff, motion = read.rate, band.kinematics, read.motion
    position = filters.smoothed(read.robot, motion.position, cutoff, rate)
    measured = low_pass(motion.velocity, cutoff, rate)
    derived = differentiate(position, rate, read.robot.model)
    velocity = np.where(noise.measures_speed(band), measured, derived)
    # A joint that holds still would seem to change direction all the time, and its dry friction, of
    # which nothing but the limits is known there, would be torque of the sign of that noise.
    still, rows = np.zeros(read.robot.model.nv), rubbing(read.robot)
    still[rows] = _REST * noise.speed_deviation(band)[rows]
    feedback = motion.feedback_torque
    return motion.replace(
        position=position,
        velocity=np.where(np.abs(velocity) < still, 0.0, velocity),
        acceleration=derivative(velocity, rate),
        feedback_torque=None if feedback is None else low_pass(feedback, cutoff, rate),
    )


def _while_turning_one_way(read: Record, noise: NoiseDensity, motion: Motion) -> NoiseDensity:
    """Return the noise with that of the torques read where no joint behind them turns round.

    The band was chosen by what the torques hold at high frequencies, noise or jumps: there is no
    reason to cut the torque of dry friction off where the sensor is quiet.
    """
    robot = read.robot
    moved = np.abs(robot.transmission.topology) > 0.0
    # A gear changes its direction with any joint that it moves: the sum over them does, too.
    ways = np.sign(motion.velocity[:, robot.actuated])
    ways = ways @ (moved * np.sqrt(np.arange(1.0, len(moved) + 1.0))[:, None])
    steady = filters.steady_level(_motor_torque(read), ways, read.rate)
    behind = filters.steady_level(read.sensed, ways[:, robot.sensed], read.rate)
    unfiltered = low_passed(read.sensed, read.rate)[1] == 0.0
    return replace(
        noise,
        torque=np.where(noise.passed == np.inf, np.minimum(noise.torque, steady), noise.torque),
        sensed=np.where(unfiltered, np.minimum(noise.sensed, behind), noise.sensed),
    )


def _motor_torque(read: Record) -> FloatArray:
    """Return (N, m) what motors report at their outputs, or what a sensor behind the gear does."""
    robot = read.robot
    torque = read.torque * np.abs(robot.transmission.gear_ratio)
    unknown = robot.sensed[~read.reported[robot.sensed]]
    torque[:, unknown] = read.sensed[:, np.isin(robot.sensed, unknown)]
    return np.asarray(torque)


def _weight(
    robot: Robot, motion: Motion, noise: NoiseDensity, band: Bandwidth, reversal: float
) -> FloatArray:
    """Return (N, m + b + s): how far the direction of motion behind each output can be trusted.

    Around a reversal the smoothed velocity is wrong about the moment and hides standstill, so
    that dry friction there cannot be told; the window scales with the band and the acceleration.
    """
    rows = rubbing(robot)
    settled = _settled(motion, band)
    speed = motion.velocity[:, rows]
    acceleration = motion.acceleration[:, rows]  # type: ignore[index]
    period = 1.0 / band.kinematics
    typical = np.sqrt(np.mean(acceleration[settled] ** 2, axis=0))
    threshold = period * typical * reversal + 4.0 * noise.speed_deviation(band)[rows]
    threshold = np.minimum(threshold, 0.5 * rms(speed))
    # A joint that holds still all the time carries a load, too.
    threshold *= noise.moving(motion.velocity, band)[rows]
    trusted = filters.gate(speed, threshold)
    # A mesh turns with every joint that its motor moves: all of them must have a direction.
    moves = np.abs(robot.transmission.topology) > 0.0
    driven, passive = np.split(trusted, [robot.transmission.size], axis=1)
    per_gear = np.where(moves, driven[:, :, None], np.inf).min(axis=1)
    return np.asarray(at_outputs(robot, per_gear, passive) * settled[:, None])


def away_from_impacts(read: Record, band: Bandwidth) -> BoolArray:
    """Return (N,) whether a sample is out of the filters' reach of every impact.

    A foot that strikes is stopped within milliseconds. The force's peak falls between two samples
    or on one of them by chance, and no filter can mend what was never recorded. The largest
    impacts go first where all of them would take most of the log.

    Args:
        read: of one log; the robot's weight is the measure.
        band: of the filters.
    """
    jump = np.zeros(len(read.torque))
    for force in read.forces.values():
        np.maximum(jump[1:], np.linalg.norm(np.diff(force, axis=0), axis=1), out=jump[1:])
    weight = sum(inertia.mass for inertia in read.robot.model.inertias) * 9.81
    reach = int(np.ceil(_REACH * read.rate / band.kinematics))
    away = np.ones(len(jump), dtype=bool)
    for k in np.argsort(-jump):
        if jump[k] < _JUMP * weight or np.mean(away) < 1.0 - _MOST:
            break
        away[max(0, k - reach) : k + reach] = False
    for touches in read.active.values():
        # A flag says the moment of a touch or a lift as roughly as a sample does.
        for k in np.flatnonzero(np.diff(touches.astype(np.int8))):
            away[max(0, k - reach) : k + reach] = False
    return away


def _settled(motion: Motion, band: Bandwidth) -> BoolArray:
    """Return where (N,) the smoothed motion does not depend on how the filter met the ends.

    Accelerations there are large and wrong, and the narrower band of the residual would carry them
    far into the log.
    """
    count = len(motion.velocity)
    step = (motion.time[-1] - motion.time[0]) / (count - 1)  # type: ignore[index]
    unsettled = min(count // 8, max(1, int(_UNSETTLED / band.kinematics / step)))
    inside = np.ones(count, dtype=bool)
    inside[:unsettled] = inside[count - unsettled :] = False
    return inside
