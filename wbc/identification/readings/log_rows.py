"""One log held against a robot: its motion and its torques on a few hundred rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from scipy import stats

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import contact_torque, link_torque, rotor_torque
from wbc.errors import IdentificationError, LogError
from wbc.identification.records.channels import read_channels, typical_inertia, without_position
from wbc.identification.records.drives import (
    reported_share,
    sensors_as_reports,
    torque_sources,
)
from wbc.identification.records.filters import smoothed
from wbc.measurement.checks import resting_joints
from wbc.measurement.filters import derivative, differentiate, low_pass
from wbc.measurement.log import Log, longest_piece, too_short
from wbc.measurement.schema import REPORTED
from wbc.robot import Motion, Robot

Described: TypeAlias = Callable[[Robot], Robot]
"""A robot -> what its description should say instead."""
BEHIND_GEARS = (".motor_torque", ".joint_torque")
"""Ends of the names of columns that are torques at the output of a gear."""

_ROUNDING = 1e-9  # of a torque, below which one is nothing
_ROWS = 400  # kept per log: more samples of one motion say no more about a gross mistake
_MOTION_SHARE = 0.999  # of the power of the positions lies below half of the cut-off
_HIGHEST = 15.0  # [Hz]: rigid links, and the band of most joint encoders
_ORDER = 4  # of each pass: what is above the cut-off must not count as motion
_MOST_RATIO = 300.0  # of gears in robots: a judgement
_BASE = 6  # coordinates of a free flyer, the first ones
_CHANCE = 1e-3  # that a report of white noise is taken for one that follows the motion
_EDGE = 0.05  # share of the log at either end, where the filter has not settled


@dataclass(frozen=True, eq=False)
class LogRows:
    """What one log says about a robot.

    Attributes:
        robot: without effects that act on torques; bodies and gears are as given.
        log: the whole log.
        motion: q (N, nq), v and a (N, nv), smoothed.
        whole: (n, m) reported torque on all rows of an even clock, N times that on the rotor [N m].
        kept: (N,) those of its rows that the motion is on.
        rate: of that clock [Hz].
        conversion: (m,) `torque` over the column of the log.
        forces: contact -> (N, 3) [N].
        torques: (m,) names of the columns that the torques were read from.
        samples: (m,) independent samples that each report amounts to.
        sensed: (N, m) what a torque sensor behind the gear measured [N m], NaN where none is: then
            it stands for the need of the links.
        inertia: (m,) the typical inertia of each driven joint with its rotor [kg m^2].
    """

    robot: Robot
    log: Log
    motion: Motion
    whole: FloatArray
    kept: IntArray
    rate: float
    conversion: FloatArray
    forces: Mapping[str, FloatArray]
    torques: list[str]
    samples: FloatArray
    sensed: FloatArray
    inertia: FloatArray

    @cached_property
    def torque(self) -> FloatArray:
        """Reported torque (N, m), N times that on the rotor [N m]."""
        return self.whole[self.kept]

    def late(self, lag: FloatArray | float) -> FloatArray:
        """Return the reported torque (N, m) read as if it were late by `lag`, (m,) or one [s]."""
        place, rows = np.arange(len(self.whole)), self.kept[:, None] + lag * self.rate
        pairs = zip(np.broadcast_to(rows, self.torque.shape).T, self.whole.T, strict=True)
        return np.stack([np.interp(when, place, column) for when, column in pairs], axis=1)

    @cached_property
    def weighs(self) -> bool:
        """Whether gravity is part of what the links need, and no sensor stands for them."""
        if self.robot.floating_size:
            return False
        held = self.as_is.links - self.need(described=without_gravity).links
        return bool(np.any(np.std(held, axis=0) > _ROUNDING))

    @cached_property
    def as_is(self) -> Need:
        """What the motion needs if every column holds what it says."""
        return self.need()

    def need(
        self,
        order: IntArray | slice = slice(None),
        factor: FloatArray | float = 1.0,
        offset: FloatArray | float = 0.0,
        described: Described | None = None,
    ) -> Need:
        """Return what the motion needs if the single joints' columns are read differently.

        Args:
            order: (n,) single joint i has the column of single joint order[i] ...
            factor: (n,) ... times this ...
            offset: (n,) ... and this added to the positions.
            described: robot -> what it should be instead, None for nothing else.
        """
        robot = self.robot if described is None else described(self.robot)
        given = self.motion
        q, v, a = map(np.array, (given.position, given.velocity, given.acceleration))
        at = np.array([robot.position_index(name) for name in robot.single_joints], dtype=np.int_)
        to = np.array([robot.velocity_index(name) for name in robot.single_joints], dtype=np.int_)
        q[:, at] = factor * q[:, at[order]] + offset
        v[:, to] = factor * v[:, to[order]]
        a[:, to] = factor * a[:, to[order]]
        contacts = contact_torque(robot, q, self.forces)
        motion = Motion(q, v, a)
        if robot.has_free_flyer:
            motion = Motion(q, v, _as_the_base_must(robot, motion, contacts))
        links = link_torque(robot, motion)
        rotor, _ = rotor_torque(robot, motion, links, contacts)
        gears = robot.transmission
        speed, change = (x[:, robot.actuated] @ gears.motor_from_joint.T for x in (v, a))
        rotors = gears.reflected_inertia * change
        links = np.where(np.isnan(self.sensed), rotor * gears.gear_ratio - rotors, self.sensed)
        return Need(links, links + rotors, speed, change)


class Need(NamedTuple):
    """What a motion needs at the motors' outputs.

    Attributes:
        links: (N, m) torque without the rotors [N m].
        whole: (N, m) with them, as far as they are described [N m].
        speed: (N, m) of the motors behind their gears [rad/s].
        change: (N, m) their acceleration [rad/s^2].
    """

    links: FloatArray
    whole: FloatArray
    speed: FloatArray
    change: FloatArray


def without_gravity(robot: Robot) -> Robot:
    """Return a robot whose links weigh nothing."""
    return robot.with_gravity(np.zeros(3))


def rows_of(robot: Robot, log: Log) -> LogRows | None:
    """Return the rows of a log, None where it cannot be held against the robot.

    A log cannot be held against it without its positions and torques, without the forces on which
    it stands, without motion, or if it is too short to be filtered. Links that need no torque (the
    shaft of a bench without a torque sensor) and drives that report noise alone tell nothing: every
    reading explains next to nothing, and the one that needs least torque, such as degrees, would
    be called the best.
    """
    whole, log = log, longest_piece(log)
    own = robot if log.machine is None else log.machine.of(robot)
    joints, resting = own.transmission.joints, resting_joints(log)
    # Behind gears that drive several joints nothing says whose need a sensor measures.
    serial = np.array_equal(own.transmission.topology, np.eye(len(joints)))
    sensors = [joint for joint in joints if serial and log.has(f"{joint}.joint_torque")]
    pairs = zip(joints, torque_sources(log, own.transmission), strict=True)
    quantities = [name or "joint_torque" * (joint in sensors) for joint, name in pairs]
    # Where a sensor alone tells a torque, it is the report of a perfect gear.
    alone = [joint for joint, n in zip(joints, quantities, strict=True) if n == "joint_torque"]
    own = replace(own, sensor_only=tuple(alone))
    log = sensors_as_reports(own, log)
    known = {*quantities} <= {*REPORTED, "joint_torque"} and not without_position(own, log)
    if too_short(log) or not joints or not known or resting >= {*own.single_joints}:
        return None
    sensors = [joint for joint in sensors if joint not in alone]
    try:
        told = read_channels(own.with_torque_sensors(sensors), log)
    except (LogError, IdentificationError):
        return None
    if own.floating_size and own.contacts and (told.active or not told.forces):
        return None
    length, rate, measured = len(told.torque), told.rate, told.motion.position
    cutoff = _cutoff(measured[:, [own.position_index(n) for n in own.single_joints]], rate)
    reported = told.torque * own.transmission.gear_ratio
    torque, behind = (low_pass(x, cutoff, rate, _ORDER) for x in (reported, told.sensed))
    inside = slice(int(_EDGE * length), length - int(_EDGE * length))
    if not _follows(reported[inside], torque[inside], 2.0 * cutoff / rate):
        return None
    shares = [reported_share(own.transmission, k, name) for k, name in enumerate(quantities)]
    thin = np.arange(length)[inside][:: max(1, length // _ROWS)]
    position = smoothed(own, measured, cutoff, rate, _ORDER)
    velocity = differentiate(position, rate, own.model)
    sensed = np.full_like(torque, np.nan)
    sensed[:, [joints.index(joint) for joint in sensors]] = behind
    # What holds a joint at rest is stiction, too: its torque may be any within it.
    samples = _samples(torque[inside])
    samples[[joint in resting for joint in joints]] = 0.0
    rows = LogRows(
        robot=own.with_acting(()),
        log=whole,
        motion=Motion(position[thin], velocity[thin], derivative(velocity, rate)[thin]),
        whole=torque,
        kept=thin,
        rate=rate,
        conversion=own.transmission.gear_ratio * shares,
        forces={n: low_pass(f, cutoff, rate, _ORDER)[thin] for n, f in told.forces.items()},
        torques=[f"{joint}.{name}" for joint, name in zip(joints, quantities, strict=True)],
        samples=samples,
        sensed=sensed[thin],
        inertia=typical_inertia(robot, [told]),
    )
    if np.all(np.std(rows.as_is.links, axis=0) <= _ROUNDING * np.std(rows.torque, axis=0)):
        return None
    return _behind_unknown_gears(rows)


def _follows(reported: FloatArray, slow: FloatArray, band: float) -> bool:
    """Whether any report holds more in the band of the motion than white noise would.

    Noise of a drive has the same power at all frequencies, so what lies above the band tells how
    much of it lies in the band. The two variances then have the ratio of Fisher's F. (Where filters
    have not settled the ratio is up to 1.5 times as large: the ends of the log are left out.)

    Args:
        reported: (N, m) torques.
        slow: (N, m) their parts in the band.
        band: of the motion, as a share of half the sample rate.
    """
    inside, outside = np.var(slow, axis=0), np.var(reported - slow, axis=0)
    limit = float(stats.f.isf(_CHANCE, band * len(slow), (1.0 - band) * len(slow)))
    return bool(np.any(inside / band > limit * outside / (1.0 - band)))


def _behind_unknown_gears(rows: LogRows) -> LogRows:
    """Return rows whose torque is scaled to the need where nobody has described the gear.

    A gear ratio of one and no rotor inertia is what `wbc init` writes where it knows neither.
    Torque on such a rotor is smaller than the need by a factor that nobody has stated; without
    that, positions in degrees, which need less, explain it better.
    """
    gears = rows.robot.transmission
    unknown = (np.abs(gears.gear_ratio) == 1.0) & (gears.reflected_inertia == 0.0)
    unknown &= np.array([not name.endswith(BEHIND_GEARS) for name in rows.torques])
    if not unknown.any():
        return rows
    need, told = (np.std(values, axis=0) for values in (rows.as_is.links, rows.torque))
    factor = np.where(unknown, np.clip(need / np.maximum(told, 1e-300), 1.0, _MOST_RATIO), 1.0)
    return replace(rows, whole=rows.whole * factor, conversion=rows.conversion * factor)


def _as_the_base_must(robot: Robot, motion: Motion, contacts: FloatArray) -> FloatArray:
    """Return the acceleration (N, nv) with that of a free base by its own equation of motion.

    No motor drives the base: H_bb a_b + H_bj a_j + c_b = J_b' f. In flight gravity and the measured
    acceleration cancel; what noise and filters leave of 9.81 m/s^2 outweighs what small motions
    of the joints need.
    """
    change = np.array(motion.acceleration)
    missing = (link_torque(robot, motion) - contacts)[:, :_BASE]
    data = robot.model.createData()
    inertia = [pin.crba(robot.model, data, q)[:_BASE, :_BASE] for q in motion.position]
    change[:, :_BASE] -= np.linalg.solve(inertia, missing[:, :, None])[:, :, 0]
    return change


def _cutoff(position: FloatArray, rate: float) -> float:
    """Return twice the frequency [Hz] below which the joints' motion (N, n) lies."""
    power = _power(position)
    moving = (total := power.sum(axis=0)) > 0.0
    if not moving.any():
        return _HIGHEST
    share = np.cumsum((power[:, moving] / total[moving]).mean(axis=1))
    frequency = np.fft.rfftfreq(len(position), 1.0 / rate)
    found = 2.0 * float(frequency[int(np.searchsorted(share, _MOTION_SHARE))])
    least, most = 4.0 * rate / (len(position) - 1), min(_HIGHEST, 0.4 * frequency[-1])
    return float(np.clip(found, least, most))


def _samples(values: FloatArray) -> FloatArray:
    """Return the degrees of freedom of signals (N, m): (sum of power)^2 / sum of squared power.

    Power per line of the spectrum; a line has two (Bendat & Piersol, Random Data, section 8.5).
    """
    power = _power(values)
    total = np.sum(power**2, axis=0)
    return np.asarray(2.0 * np.sum(power, axis=0) ** 2 / np.where(total > 0.0, total, np.inf))


def _power(values: FloatArray) -> FloatArray:
    """Return the spectrum of power of signals (N, m)."""
    window = np.hanning(len(values))[:, None]
    return np.abs(np.fft.rfft((values - values.mean(axis=0)) * window, axis=0)) ** 2
