"""One log held against a robot: motion and torque on a few hundred rows, and how well they agree.

The report of joint k, at the output of its motor, is modelled as

    r = g (n + kappa |n| sgn v) + c a + f_v v + f_c sgn v + offset + error,

with n what the links need, v and a speed and acceleration of the motor. Physics fixes the signs:
g, kappa, f_v, f_c > 0 and 0 <= c <= a few times the joint's inertia; g is near one. Signs, sides
and units are thus told by what no drive, friction or payload imitates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy import stats
from scipy.special import logsumexp

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import contact_torque, link_torque, rotor_torque
from wbc.measurement.filters import derivative, differentiate, low_pass, residual_noise
from wbc.measurement.log import Log
from wbc.measurement.torque import rotor_torques, torque_quantity
from wbc.robot import Motion, Robot

GAIN_SPREAD = float(np.log(4.0)) / 2.0
"""Standard deviation of ln g. A judgement: drives, losses and loads amount to less than a factor 4
in 95 of 100 machines."""

GAINS = np.exp(np.arange(-27.5, 28.0) / 9.0 * GAIN_SPREAD)  # to three standard deviations
GAIN_PRIOR = -0.5 * (np.log(GAINS) / GAIN_SPREAD) ** 2
GAIN_PRIOR -= logsumexp(GAIN_PRIOR)
_RATIOS = np.exp(np.linspace(-2.5, 2.5, 101))
_RATIO_PRIOR = -0.5 * np.log(_RATIOS) ** 2  # ratios of robots' gears differ by e or so
_RATIO_PRIOR -= logsumexp(_RATIO_PRIOR)
_ROTOR_SPREAD = 0.4  # standard deviation of ln of a rotor's inertia over that of its data sheet ...
_ROTOR_WRONG = float(np.log(0.02))  # ... unless it is simply wrong
_ALIKE = 0.15  # standard deviation of ln g between drives of one kind
_UNRELATED = float(np.log(0.1))  # a drive that carried nothing: a judgement, TIAGo has three
_STRANGE = float(np.log(0.002))  # a large report that follows something else: a judgement
_CAUSES = 5  # offset, speed, direction, loss under load, acceleration
_EITHER_WAY = -4.0 * float(np.log(2.0))  # four coefficients of either sign: half of the odds each
_IDLE = 0.1  # share of the need below which a report may well be that of an idle drive
_MOST = 20.0  # times the need: friction of 113 true reports of nine recorded machines is not above
# Share of a report's power below which it does not matter what rigid bodies and friction leave: of
# 2114 true reports of generated robots with hidden causes 92 % leave less, half of them 0.1 %.
_PHYSICS = 0.015
_MOST_SAMPLES = 40.0  # beyond them errors of the model repeat themselves
_WORST = 1e6  # share of power that a fit leaves, beyond which none is worse
_ROUNDING = 1e-9  # of the largest cause, below which one is nothing: a joint that carries no load
_INERTIA = 3.0  # times a joint's own inertia that a forgotten rotor may have


class Report(NamedTuple):
    """What a report says, for each gain: one joint, one way to read the columns."""

    gains: FloatArray
    """(G,) log likelihood at each gain of the grid."""
    gain: float
    """The likeliest gain."""
    left: float
    """Share of the report's power that is left there."""
    idle: float
    """Log likelihood, with its prior, of a drive that carried nothing in this log."""
    causes: FloatArray
    """(R, 5) what offset, speed, direction, load and acceleration add, over the report's size."""
    target: FloatArray
    """(R,) the report in the same coordinates, over its size."""
    samples: float
    """Independent samples that count."""
    ratios: FloatArray
    """(F,) log likelihood at each factor of the grid by which the gear ratio may be another."""


def report(
    reported: FloatArray,
    need: Need,
    joint: int,
    samples: float,
    inertia: float,
    rotor: float,
    power: float,
) -> Report:
    """Return how a report agrees with a need.

    Args:
        reported: (N,) torque at the output of the motor [N m].
        need: of all joints.
        joint: which of them.
        samples: independent samples that the report amounts to.
        inertia: typical inertia of the joint, with its rotor [kg m^2].
        rotor: reflected inertia of the rotor alone [kg m^2]; 0 where it is not known.
        power: by which a gain follows from a factor of the gear ratio: -1 for what is measured on
            the rotor, 0 for torque behind the gear.
    """
    size = float(np.sqrt(np.sum((reported - reported.mean()) ** 2)))
    if size <= 0.0:
        nothing = np.zeros((1, _CAUSES))
        flat = np.zeros(GAINS.size)
        return Report(flat, 0.0, 1.0, 0.0, nothing, nothing[:, 0], 0.0, np.zeros(_RATIOS.size))
    causes, drawn = _columns(need, joint)
    table = np.column_stack([causes, drawn, reported / size])
    reduced: FloatArray = np.asarray(np.linalg.qr(table, mode="r"))
    limit = _INERTIA * inertia / size
    count = min(samples, _MOST_SAMPLES)
    gains, left = _likelihoods(reduced, GAINS / size, rotor, limit, count)
    ratios = np.zeros(_RATIOS.size)
    if rotor > 0.0:
        inertias = rotor / size * _RATIOS ** (power + 2.0)
        ratios = _log(_held(reduced, _RATIOS**power / size, inertias), count)
    best = int(np.argmax(gains))
    whole = drawn + rotor * need.change[:, joint]
    own, target = reduced[:, :-2] / size, reduced[:, -1]
    free = _EITHER_WAY + float(_log(_free_misfits([own], [target]), count)[0])
    return Report(
        gains=gains - 0.5 * _excess(size, whole, _MOST) ** 2,
        gain=float(GAINS[best]),
        left=float(left[best]),
        idle=free + _UNRELATED - 0.5 * _excess(size, whole, _IDLE) ** 2,
        causes=own,
        target=target,
        samples=count,
        ratios=ratios,
    )


def ratio_evidence(reports: Sequence[Sequence[Report]]) -> tuple[float, float]:
    """Return (log evidence of one factor on all gear ratios, the likeliest factor).

    The gear ratio shows twice: in what is measured on the rotor, and in the rotor's reflected
    inertia. A torque constant, a payload or a rotor that is wrong shows once.

    Args:
        reports: per log, of all joints.
    """
    total = np.sum([one.ratios for log in reports for one in log], axis=0)
    return float(logsumexp(_RATIO_PRIOR + total)), float(_RATIOS[int(np.argmax(total))])


def evidence(logs: Sequence[tuple[Sequence[Report], FloatArray]]) -> float:
    """Return the log evidence of the reports of all joints in all logs.

    The gain of a joint is the same in all logs. Gains are drawn apart or alike (one kind of drive,
    one unit), with equal odds. In a log a drive may have carried nothing; and a joint may have
    something else than the need in its reports, which is then so in all logs.

    Args:
        logs: per log, the reports of all joints, read in one way; and (m,) log likelihoods of the
            same columns if they mean nothing, which do not depend on how the columns are read.
    """
    total = np.sum(
        [
            np.logaddexp(np.stack([one.gains for one in reports]), idle[:, None])
            for reports, idle in logs
        ],
        axis=0,
    )
    joints = zip(*(reports for reports, _ in logs), strict=True)
    strange = np.array([_STRANGE + _strange(reports) for reports in joints])
    apart = float(np.sum(np.logaddexp(logsumexp(GAIN_PRIOR + total, axis=1), strange)))
    near = -0.5 * (np.log(GAINS[:, None] / GAINS) / _ALIKE) ** 2
    near -= logsumexp(near, axis=1, keepdims=True)
    given = np.logaddexp(logsumexp(near[None] + total[:, None, :], axis=2), strange[:, None])
    alike = float(logsumexp(GAIN_PRIOR + given.sum(axis=0)))
    return float(np.logaddexp(apart, alike) - np.log(2.0))


def _strange(reports: Sequence[Report]) -> float:
    """Return the log likelihood that a joint's reports follow anything but what it needs.

    Speed, direction, load and acceleration may go either way, but the same way in all logs.
    """
    left = _free_misfits([one.causes for one in reports], [one.target for one in reports])
    samples = np.array([one.samples for one in reports])
    return _EITHER_WAY + float(np.sum(_log(left, samples)))


def _free_misfits(causes: Sequence[FloatArray], targets: Sequence[FloatArray]) -> FloatArray:
    """Return the share of each report's power that causes of either sign leave."""
    whole, target = np.concatenate(causes), np.concatenate(targets)
    left = target - whole @ np.linalg.lstsq(whole, target, rcond=_ROUNDING)[0]
    ends = np.cumsum([len(one) for one in targets])[:-1]
    return np.array([float(part @ part) for part in np.split(left, ends)])


def _excess(size: float, need: FloatArray, most: float) -> float:
    """Return by how many standard deviations a report is larger than so many times the need."""
    share = size / max(float(np.sqrt(np.sum((need - need.mean()) ** 2))), 1e-300)
    return max(0.0, float(np.log(share / most))) / GAIN_SPREAD


def _columns(need: Need, joint: int) -> tuple[FloatArray, FloatArray]:
    """Return (N, 5): offset, speed, direction, loss under load, acceleration; and the need (N,)."""
    speed = need.speed[:, joint]
    links = need.links[:, joint]
    # A direction is no sharper than the filter that the speed has gone through.
    way = np.tanh(speed / max(0.1 * float(np.std(speed)), 1e-12))
    causes = [np.ones(speed.size), speed, way, np.abs(links) * way, need.change[:, joint]]
    return np.column_stack(causes), links


def _likelihoods(
    reduced: FloatArray, gains: FloatArray, rotor: float, limit: float, count: float
) -> tuple[FloatArray, FloatArray]:
    """Return the log likelihood at each gain, and the share of power left there.

    A rotor unlike its data sheet has its price.
    """
    left, inertia = _misfits(reduced, gains, limit)
    free = _log(left, count)
    if rotor <= 0.0:
        return free, left
    size = np.log(np.maximum(inertia, 1e-300) / (gains * rotor))
    price = np.maximum(-0.5 * (size / _ROTOR_SPREAD) ** 2, _ROTOR_WRONG)
    return np.maximum(free + price, _log(_held(reduced, gains, gains * rotor), count)), left


def _log(left: FloatArray, count: FloatArray | float) -> FloatArray:
    return np.asarray(-0.5 * count * np.log(np.minimum(left, _WORST) + _PHYSICS))


def _held(reduced: FloatArray, gains: FloatArray, inertias: FloatArray) -> FloatArray:
    """Return the share of power left at each gain and coefficient of the acceleration."""
    targets = reduced[:, -1:] - gains * reduced[:, -2:-1] - inertias * reduced[:, -3:-2]
    return _positive(reduced[:, :-3], targets)[0]


def _misfits(reduced: FloatArray, gains: FloatArray, limit: float) -> tuple[FloatArray, FloatArray]:
    """Return (share of power left, coefficient of the acceleration) at each gain."""
    left, found = _positive(reduced[:, :-2], reduced[:, -1:] - gains * reduced[:, -2:-1])
    inertia = np.minimum(found[-1], limit)
    over = found[-1] > limit
    left[over] = _held(reduced, gains[over], inertia[over])
    return left, inertia


def _positive(causes: FloatArray, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what causes leave of each target at least, (G,) squares, and their coefficients.

    None but the first, the offset, may be below zero. So few causes have few subsets: the best
    coefficients are the least squares of one of them.

    Args:
        causes: (R, n).
        targets: (R, G).

    Returns:
        (G,), (n, G).
    """
    used = np.array([(1.0, *others) for others in product((0.0, 1.0), repeat=causes.shape[1] - 1)])
    subsets = causes * used[:, None]
    found = (np.linalg.pinv(subsets, rcond=_ROUNDING) @ targets) * used[:, :, None]
    left = np.sum((targets - subsets @ found) ** 2, axis=1)
    left[(found[:, 1:] < 0.0).any(axis=1)] = np.inf
    best = np.argmin(left, axis=0)
    each = np.arange(best.size)
    return left[best, each], found[best, :, each].T


_LAGS = (0.02, 0.03, 0.05, 0.08, 0.12)  # [s] of torques that a bus or a filter holds back
_SHOWN_LAG = 0.02  # of a period of the band's edge, below which a lag does not show
_ROWS = 400  # kept per log: more samples of one motion say no more about a gross mistake
_MOTION_SHARE = 0.999  # of the power of the positions lies below half of the cut-off
_HIGHEST = 15.0  # [Hz]: rigid links, and the band of most joint encoders
_MOVES = 5.0  # times the noise of an encoder: white noise itself has one
_ORDER = 4  # of each pass: what is above the cut-off must not count as motion
_MOST_RATIO = 300.0  # of gears in robots: a judgement
_BASE = 6  # coordinates of a free flyer, the first ones
_CHANCE = 1e-3  # that a report of white noise is taken for one that follows the motion
_EDGE = 0.05  # share of the log at either end, where the filter has not settled


@dataclass(frozen=True, eq=False)
class LogRows:
    """What one log says about a robot.

    Attributes:
        label: of the log.
        robot: without effects that act on torques; bodies and gears are as given.
        position: q (N, nq), smoothed.
        velocity: v (N, nv).
        acceleration: a (N, nv).
        torque: (N, m) reported torque, N times that on the rotor [N m].
        conversion: (m,) `torque` over the column of the log.
        forces: contact -> (N, 3) [N].
        quantities: (m,) which column each torque was read from.
        samples: (m,) independent samples that each report amounts to.
        sensed: (N, m) what a torque sensor behind the gear measured [N m], NaN where none is: then
            it stands for the need of the links.
        late: lag [s] -> (N, m) `torque` read as that much late.
    """

    label: str
    robot: Robot
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    conversion: FloatArray
    forces: Mapping[str, FloatArray]
    quantities: tuple[str, ...]
    samples: FloatArray
    sensed: FloatArray
    late: Mapping[float, FloatArray]

    @cached_property
    def weighs(self) -> bool:
        """Whether gravity is part of what the links need, and no sensor stands for them."""
        robot = self.robot
        still = Motion(self.position, 0.0 * self.velocity, 0.0 * self.velocity)
        held = link_torque(robot, still)[:, robot.actuated]
        known = np.isnan(self.sensed).all() and not robot.floating_size
        return bool(known and np.any(np.std(held, axis=0) > _ROUNDING))

    def need(
        self,
        order: np.ndarray,
        factor: FloatArray,
        weight: float = 1.0,
        offset: FloatArray | None = None,
    ) -> Need:
        """Return what the motion needs if the single joints' columns are read differently.

        Args:
            order: (n,) single joint i has the column of single joint order[i] ...
            factor: (n,) ... times this.
            weight: share of gravity that is part of the need.
            offset: (n,) added to the positions of the single joints; None for nothing.
        """
        robot = self.robot
        q, v, a = self.position.copy(), self.velocity.copy(), self.acceleration.copy()
        at = np.array([robot.position_index(name) for name in robot.single_joints], dtype=np.int_)
        to = np.array([robot.velocity_index(name) for name in robot.single_joints], dtype=np.int_)
        q[:, at] = factor * self.position[:, at[order]] + (0.0 if offset is None else offset)
        v[:, to] = factor * self.velocity[:, to[order]]
        a[:, to] = factor * self.acceleration[:, to[order]]
        contacts = contact_torque(robot, q, self.forces)
        motion = Motion(q, v, a)
        if robot.has_free_flyer:
            motion = Motion(q, v, _as_the_base_must(robot, motion, contacts))
        links = link_torque(robot, motion)
        if weight != 1.0:
            links = links - (1.0 - weight) * link_torque(robot, Motion(q, 0.0 * v, 0.0 * a))
        rotor, _ = rotor_torque(robot, motion, links, contacts)
        gears = robot.transmission
        lift = gears.motor_from_joint.T
        speed, change = v[:, robot.actuated] @ lift, a[:, robot.actuated] @ lift
        links = rotor * gears.gear_ratio - gears.reflected_inertia * change
        return Need(np.where(np.isnan(self.sensed), links, self.sensed), speed, change)


@dataclass(frozen=True, eq=False)
class Need:
    """What a motion needs at the motors' outputs, without their rotors.

    Attributes:
        links: (N, m) torque [N m].
        speed: (N, m) of the motors behind their gears [rad/s].
        change: (N, m) their acceleration [rad/s^2].
    """

    links: FloatArray
    speed: FloatArray
    change: FloatArray


def rows_of(robot: Robot, log: Log) -> LogRows | None:
    """Return the rows of a log, None where it cannot be held against the robot.

    That is so for a log without the positions and torques that the robot has, for one without the
    forces on a robot that stands on them, for one too short to be filtered, for one without motion,
    for links that need no torque, such as the shaft of a bench without a torque sensor, and for
    drives that report nothing but noise: then every reading explains next to nothing, and the one
    that needs least torque, such as degrees, would be called the best.
    """
    robot = robot if log.machine is None else log.machine.of(robot)
    joints = robot.transmission.joints
    if not joints or not _has_all(robot, log) or len(log) < 50:
        return None
    forces = {c.name: c.name for c in robot.contacts if c.name in log.contacts}
    flagged = any(log.has(f"{c.name}.active") and c.name not in forces for c in robot.contacts)
    if robot.floating_size and robot.contacts and (flagged or not forces):
        return None
    grid = np.linspace(log.time[0], log.time[-1], round(log.duration / log.sample_time) + 1)
    if not _moves(robot, log):
        return None
    raw = _positions(robot, log)
    position = np.stack([np.interp(grid, log.time, column) for column in raw.T], axis=1)
    cutoff = _cutoff(position[:, [robot.position_index(n) for n in robot.single_joints]], grid)
    if not 1.0 / log.duration < cutoff < 0.45 / log.sample_time:
        return None
    q, v, a = _motion(robot, grid, position, cutoff)
    reported = rotor_torques(log, robot.transmission) * robot.transmission.gear_ratio
    on_grid = np.stack([np.interp(grid, log.time, column) for column in reported.T], axis=1)
    rate = 1.0 / float(grid[1] - grid[0])
    torque = low_pass(on_grid, cutoff, rate, _ORDER)

    def slow(columns: Sequence[FloatArray]) -> FloatArray:
        even = np.stack([np.interp(grid, log.time, column) for column in columns], axis=1)
        return low_pass(even, cutoff, rate, _ORDER)

    held = {name: slow(_force(log, name)) for name in forces}
    sensed = np.full_like(torque, np.nan)
    sensors = [k for k, joint in enumerate(joints) if log.has(f"{joint}.joint_torque")]
    if sensors and np.array_equal(robot.transmission.topology, np.eye(len(joints))):
        sensed[:, sensors] = slow([log.column(f"{joints[k]}.joint_torque") for k in sensors])
    inside = slice(int(_EDGE * grid.size), grid.size - int(_EDGE * grid.size))
    pairs = zip(on_grid[inside].T, torque[inside].T, strict=True)
    if not any(_follows(raw, slow, 2.0 * cutoff / rate) for raw, slow in pairs):
        return None
    thin = np.arange(grid.size)[inside][:: max(1, grid.size // _ROWS)]
    quantities = tuple(torque_quantity(log, joint, robot.transmission) for joint in joints)
    rows = LogRows(
        label=log.source.label,
        robot=robot.with_acting(()),
        position=q[thin],
        velocity=v[thin],
        acceleration=a[thin],
        torque=torque[thin],
        conversion=_conversion(robot, quantities),
        forces={name: force[thin] for name, force in held.items()},
        quantities=quantities,
        samples=np.array([_samples(column) for column in torque[inside].T]),
        sensed=sensed[thin],
        late=_late(torque, rate, thin, cutoff),
    )
    single = len(robot.single_joints)
    need = rows.need(np.arange(single), np.ones(single)).links
    if np.all(np.std(need, axis=0) <= _ROUNDING * np.std(rows.torque, axis=0)):
        return None
    return _behind_unknown_gears(rows)


def _late(
    torque: FloatArray, rate: float, rows: IntArray, cutoff: float
) -> dict[float, FloatArray]:
    """Return the torque at some rows, read as if it were late by each of `_LAGS`.

    Within a tenth of a period of the band's edge a lag does not show.
    """
    place = np.arange(len(torque))
    return {
        lag: np.stack([np.interp(rows + lag * rate, place, column) for column in torque.T], axis=1)
        for lag in _LAGS
        if lag * cutoff > _SHOWN_LAG
    }


def _follows(reported: FloatArray, slow: FloatArray, band: float) -> bool:
    """Whether a report holds more in the band of the motion than white noise would.

    Noise of a drive has the same power at all frequencies, so what lies above the band tells how
    much of it lies in the band. The two variances then have the ratio of Fisher's F. (Where filters
    have not settled the ratio is up to 1.5 times as large: the ends of the log are left out.)

    Args:
        reported: (N,) torque.
        slow: (N,) its part in the band.
        band: of the motion, as a share of half the sample rate.
    """
    inside, outside = float(np.var(slow)), float(np.var(reported - slow))
    counts = band * slow.size, (1.0 - band) * slow.size
    limit = float(stats.f.isf(_CHANCE, *counts))
    return inside / band > limit * outside / (1.0 - band)


def _behind_unknown_gears(rows: LogRows) -> LogRows:
    """Return rows whose torque is scaled to the need where nobody has described the gear.

    A gear ratio of one and no rotor inertia is what `wbc init` writes where it knows neither.
    Torque on such a rotor is smaller than the need by a factor that nobody has stated; without
    that, positions in degrees, which need less, explain it better.
    """
    gears, single = rows.robot.transmission, len(rows.robot.single_joints)
    unknown = (np.abs(gears.gear_ratio) == 1.0) & (gears.reflected_inertia == 0.0)
    unknown &= np.array([quantity != "motor_torque" for quantity in rows.quantities])
    if not unknown.any():
        return rows
    size = np.std(rows.need(np.arange(single), np.ones(single)).links, axis=0)
    factor = np.clip(size / np.maximum(np.std(rows.torque, axis=0), 1e-300), 1.0, _MOST_RATIO)
    factor[~unknown] = 1.0
    return replace(rows, torque=rows.torque * factor, conversion=rows.conversion * factor)


def _as_the_base_must(robot: Robot, motion: Motion, contacts: FloatArray) -> FloatArray:
    """Return the acceleration (N, nv) with that of a free base by its own equation of motion.

    No motor drives the base: H_bb a_b + H_bj a_j + c_b = J_b' f. In flight gravity and the measured
    acceleration cancel; what noise and filters leave of 9.81 m/s^2 outweighs what small motions
    of the joints need.
    """
    change = np.zeros_like(motion.velocity)
    if motion.acceleration is not None:
        change += motion.acceleration
    missing = (link_torque(robot, motion) - contacts)[:, :_BASE]
    data = robot.model.createData()
    for row, (q, wrench) in enumerate(zip(motion.position, missing, strict=True)):
        inertia = pin.crba(robot.model, data, q)[:_BASE, :_BASE]
        whole = np.triu(inertia) + np.triu(inertia, 1).T
        change[row, :_BASE] -= np.linalg.solve(whole, wrench)
    return change


def _has_all(robot: Robot, log: Log) -> bool:
    if not log.has(*(f"{name}.position" for name in robot.single_joints)):
        return False
    if robot.has_free_flyer and not log.has(
        *(f"base.position.{axis}" for axis in "xyz"),
        *(f"base.orientation.{axis}" for axis in "xyzw"),
    ):
        return False
    constant = robot.transmission.torque_constant
    for k, joint in enumerate(robot.transmission.joints):
        if log.has(f"{joint}.rotor_torque") or log.has(f"{joint}.motor_torque"):
            continue
        if not log.has(f"{joint}.current") or not np.isfinite(constant[k]):
            return False
    return True


def _moves(robot: Robot, log: Log) -> bool:
    """Whether any joint moves by more than the noise of its encoder."""
    channels = [log.column(f"{name}.position") for name in robot.single_joints]
    return any(np.std(q) > _MOVES * residual_noise(log.time, q) for q in channels)


def _positions(robot: Robot, log: Log) -> FloatArray:
    position = np.tile(robot.neutral(), (len(log), 1))
    for name in robot.single_joints:
        position[:, robot.position_index(name)] = log.column(f"{name}.position")
    if robot.has_free_flyer:
        position[:, :3] = np.stack([log.column(f"base.position.{axis}") for axis in "xyz"], axis=1)
        turn = np.stack([log.column(f"base.orientation.{axis}") for axis in "xyzw"], axis=1)
        position[:, 3:7] = turn
    return position


def _force(log: Log, contact: str) -> list[FloatArray]:
    zero = np.zeros(len(log))
    names = [f"{contact}.force.{axis}" for axis in "xyz"]
    return [log.column(name) if log.has(name) else zero for name in names]


def _cutoff(position: FloatArray, grid: FloatArray) -> float:
    """Return twice the frequency [Hz] below which the joints' motion lies."""
    window = np.hanning(grid.size)[:, None]
    power = np.abs(np.fft.rfft((position - position.mean(axis=0)) * window, axis=0)) ** 2
    total = power.sum(axis=0)
    moving = total > 0.0
    if not moving.any():
        return _HIGHEST
    share = np.cumsum((power[:, moving] / total[moving]).mean(axis=1))
    frequency = np.fft.rfftfreq(grid.size, float(grid[1] - grid[0]))
    found = 2.0 * float(frequency[int(np.searchsorted(share, _MOTION_SHARE))])
    return float(np.clip(found, 4.0 / (grid[-1] - grid[0]), min(_HIGHEST, 0.4 * frequency[-1])))


def _motion(
    robot: Robot, grid: FloatArray, position: FloatArray, cutoff: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q (N, nq), v and a (N, nv) of a low-passed motion."""
    rate = 1.0 / float(grid[1] - grid[0])
    q = low_pass(position, cutoff, rate, _ORDER)
    if robot.has_free_flyer:
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    v = differentiate(q, rate, robot.model)
    return q, v, derivative(v, rate)


def _conversion(robot: Robot, quantities: tuple[str, ...]) -> FloatArray:
    gears = robot.transmission
    factors = {
        "rotor_torque": gears.gear_ratio,
        "motor_torque": np.ones(gears.size),
        "current": gears.gear_ratio * gears.torque_constant,
    }
    return np.array([factors[quantity][k] for k, quantity in enumerate(quantities)])


def _samples(values: FloatArray) -> float:
    """Return the degrees of freedom of a signal: (sum of power)^2 / sum of squared power.

    Power per line of the spectrum; a line has two (Bendat & Piersol, Random Data, section 8.5).
    """
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(values.size))) ** 2
    total = float(np.sum(power**2))
    return 2.0 * float(np.sum(power)) ** 2 / total if total > 0.0 else 0.0
