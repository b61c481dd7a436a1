"""The noise floor: what the residual of a perfect model would still be.

White noise of the level measured in each log is drawn and sent through filters and model; repeated
runs raise what it leaves. The load of a link behind a soft gear is believed as far as it is more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.signal import welch

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics.batch import contact_torque, inverse_dynamics
from wbc.identification.records.record import Record, judged, output_count, rms, rows_per_sample
from wbc.measurement import derivative, low_pass

_SHRINKAGE = 0.03
_ROWS = 1500  # of drawn noise per log, by which its covariance is known to some 5 % ...
_DRAWS = 16  # ... but no more draws than this
_SAME_MOTION = 0.02  # of the range of motion: of runs this close only the noise differs
_LEAST = 1.7  # of the residual's band: a filter there hardly touches the band
_MORE = 1.4  # times the power of the noise, which loads that are believed have
_RESOLUTION = 1.0  # [Hz]
_STEEP = 6  # order of each pass of the filter


@dataclass(frozen=True, eq=False)
class NoiseFloor:
    """The residual that noise alone leaves.

    Attributes:
        covariance: (m + b, m + b) of the outputs [N m, N].
        sensors: the same from the white noise of the sensors alone, a lower bound.
        repeats: pairs of record numbers that repeat one another; with none, `covariance` is the
            lower bound.
        aside: numbers of outputs that are not judged, because nothing can be learnt from them.
        samples: independent samples of noise that it is known from.
    """

    covariance: FloatArray
    sensors: FloatArray
    repeats: tuple[tuple[int, int], ...]
    aside: tuple[int, ...] = ()
    samples: float = np.inf

    @property
    def values(self) -> FloatArray:
        """Root mean square (m + b,) per output [N m, N]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def excesses(self) -> FloatArray:
        """How many times (m + b,) the floor is what the sensors explain."""
        return np.asarray(np.sqrt(np.diag(self.covariance) / np.diag(self.sensors)))

    @property
    def judged(self) -> IntArray:
        """(k,) numbers of the outputs that are not set aside."""
        return np.setdiff1d(np.arange(len(self.covariance)), self.aside)

    @cached_property
    def whitening(self) -> FloatArray:
        """W (m + b, k): residual @ W has unit covariance where there is only noise.

        k counts the outputs that are not set aside. Outputs that share their noise (a joint and the
        base it pushes against, through the same contact force) are judged by their differences,
        too; correlations are shrunk a little, since no model is so good that noise cancels
        altogether.
        """
        kept, size = self.judged, self.values[self.judged]
        correlation = self.covariance[np.ix_(kept, kept)] / np.outer(size, size)
        shrunk = (1.0 - _SHRINKAGE) * correlation + _SHRINKAGE * np.eye(size.size)
        lower = np.linalg.cholesky(shrunk)
        weights = np.zeros((len(self.covariance), len(kept)))
        weights[kept] = np.linalg.inv(lower).T / size[:, None]
        return weights

    @property
    def source(self) -> str:
        """`repeats` or `lower bound`."""
        return "repeats" if self.repeats else "lower bound"


def drawn_noise(records: Sequence[Record]) -> list[FloatArray]:
    """Return what the sensors' white noise does to the residual of each record, (rows, m + b).

    A short log in a narrow band has few independent samples: noise drawn once would be as much
    off as the noise of the log itself, and the inverse of its covariance far more. There it is
    drawn several times, one below the other.
    """
    found = []
    for record in records:
        times = int(np.clip(np.ceil(_ROWS / record.rows), 1, _DRAWS))
        draws = [record.condense(np.add(*synthetic_noise(record, k))) for k in range(times)]
        found.append(np.concatenate(draws))
    return found


def with_even_noise(
    records: Sequence[Record], drawn: Sequence[FloatArray], repeats: Sequence[tuple[int, int]]
) -> tuple[tuple[Record, ...], list[FloatArray]]:
    """Return records and drawn noise with rows scaled so that the noise is equal in all of them.

    The weight around reversals carries noise of higher frequencies into the residual's band: a
    log that reverses often is noisier than a calm one with the same sensors. Where runs repeat
    one another the floor is theirs. Quieter logs are not counted for more: what a model lacks
    there may be no smaller.
    """
    levels = np.array([np.mean(noise**2, axis=0) for noise in drawn]) + 1e-300
    repeated = sorted({k for pair in repeats for k in pair})
    weighed = judged(records)
    chosen = weighed & np.isin(range(len(records)), repeated)[:, None]
    chosen = np.where(chosen.any(axis=0), chosen, weighed)
    reference = np.sum(levels * chosen, axis=0) / np.maximum(chosen.sum(axis=0), 1)
    certainty = np.minimum(np.sqrt(reference / levels), 1.0)
    even = tuple(replace(r, certainty=share) for r, share in zip(records, certainty, strict=True))
    return even, [noise * share for noise, share in zip(drawn, certainty, strict=True)]


def noise_floor(
    records: Sequence[Record],
    residuals: Sequence[FloatArray],
    drawn: Sequence[FloatArray],
    repeats: Sequence[tuple[int, int]],
) -> NoiseFloor:
    """Return the floor from repeated runs where there are any, never below the sensors' noise.

    The steps of an encoder repeat with the motion: two runs of an arm differed by 0.018 N m where
    they leave 0.056.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each.
        drawn: (rows, m + b) noise of the sensors in each.
        repeats: pairs of logs, as of `close_repeats`.
    """
    noise, per_sample = np.concatenate(drawn), rows_per_sample(records)
    sensors = _covariance(noise)
    if not repeats:
        return NoiseFloor(sensors, sensors, (), samples=len(noise) / per_sample)
    pairs = ((residuals[i], records[i].time, residuals[j], records[j].time) for i, j in repeats)
    noise = np.concatenate([_difference(*pair) / np.sqrt(2.0) for pair in pairs])
    # An output may have no weight in some logs: their rows count as zeros in every mean. Where it
    # has none in the repeats, the sensors' noise is all that is known.
    weighed, rows = judged(records), np.array([record.rows for record in records])
    repeated = [i for i, _ in repeats]
    everywhere = rows @ weighed / rows.sum()
    there = rows[repeated] @ weighed[repeated] / rows[repeated].sum()
    known = there > 0.0
    scale = np.sqrt(np.divide(everywhere, there, out=np.zeros(known.size), where=known))
    covariance = _covariance(noise) * np.outer(scale, scale) + sensors * np.outer(~known, ~known)
    raised = np.sqrt(np.maximum(np.diag(sensors) / np.diag(covariance), 1.0))
    covariance *= np.outer(raised, raised)
    return NoiseFloor(covariance, sensors, tuple(repeats), samples=len(noise) / per_sample)


def _covariance(values: FloatArray) -> FloatArray:
    """Return the second moments (k, k) of `values` (rows, k) about zero."""
    moments = values.T @ values / len(values)
    # An output without any noise (a constant channel) must not get infinite weight.
    least = 1e-12 * float(np.trace(moments)) + 1e-300
    return np.asarray(moments + least * np.eye(len(moments)))


def close_repeats(
    records: Sequence[Record], groups: Sequence[Sequence[int]]
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of repeated runs so close that what differs between them is noise.

    Args:
        records: the logs.
        groups: indices of logs of the same excitation, as of `find_repeats`.
    """
    pairs = (pair for group in groups for pair in combinations(group, 2))
    return tuple((i, j) for i, j in pairs if _close(records[i], records[j]))


def _difference(
    one: FloatArray, time: FloatArray, other: FloatArray, later: FloatArray
) -> FloatArray:
    """Return by how much two runs (rows, k) differ at the same time since their start."""
    if np.array_equal(time, later):
        return one - other
    both = time <= later[-1]
    # Rows are a third of the band's period apart: lines between them cut its corners.
    return np.asarray(one[both] - CubicSpline(later, other)(time[both]))


def _close(one: Record, other: Record) -> bool:
    first, second = one.motion, other.motion
    spread = np.ptp(first.velocity, axis=0)
    # Noise and tremor of a held joint repeat nothing.
    moving = (spread > 0.0) & one.noise.moving(first.velocity, one.bandwidth)
    driven = one.robot.actuated
    moving[driven] &= one.weight[:, : driven.size].any(axis=0)
    times = np.asarray(first.time), np.asarray(second.time)
    apart = rms(_difference(first.velocity, times[0], second.velocity, times[1]))
    return bool(moving.any() and np.all(apart[moving] < _SAME_MOTION * spread[moving]))


def synthetic_noise(record: Record, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return drawn noise (N, m + b + s) of the reported torque, and of what the model needs.

    Positions, velocities, torques and forces get white noise of the level found in the log, the
    same filters, and the model's mass matrix and contact Jacobians.

    Args:
        record: one log.
        seed: of what is drawn.
    """
    robot, noise, random = record.robot, record.noise, np.random.default_rng(seed)
    acceleration, torque_of = _shaken(record, random)
    torque = torque_of(record.model_of(robot))
    forces = {name: _white(record, random, level) for name, level in noise.forces.items()}
    torque -= contact_torque(robot, record.motion.position, forces)
    sensed = _white(record, random, noise.sensed)
    return reported_noise(record, random), _needed(record, torque, acceleration, sensed)


def reported_noise(record: Record, random: np.random.Generator) -> FloatArray:
    """Return drawn noise (N, m + b + s) of the reported torque."""
    drawn = _seen(record, _white(record, random, record.noise.torque))
    return np.pad(drawn, ((0, 0), (0, output_count(record.robot) - drawn.shape[1])))


def _seen(record: Record, torque: FloatArray) -> FloatArray:
    """Return what of torque (N, m) at the motors no contact force that was not measured can be."""
    if record.balance is None:
        return torque
    sign = np.sign(record.robot.transmission.gear_ratio)
    return sign * record.balance.seen(sign * torque)


def noise_of_links(record: Record) -> Callable[[pin.Model], FloatArray]:
    """Return what links make of noise of the motion, drawn once: (rows, m + b) of a model."""
    acceleration, torque = _shaken(record, np.random.default_rng(0))
    sensed = np.zeros_like(record.sensed)
    return lambda model: record.condense(_needed(record, torque(model), acceleration, sensed))


def _white(record: Record, random: np.random.Generator, level: FloatArray) -> FloatArray:
    """Return drawn noise (N, k) of levels (k,), filtered as the log was."""
    sigma = np.sqrt(np.maximum(np.nan_to_num(level), 0.0) * 0.5 * record.rate)
    drawn = sigma * random.standard_normal((len(record.motion.velocity), level.size))
    return low_pass(drawn, record.bandwidth.kinematics, record.rate)


def _shaken(
    record: Record, random: np.random.Generator
) -> tuple[FloatArray, Callable[[pin.Model], FloatArray]]:
    """Return drawn errors of accelerations, and what they and those of positions change (N, nv).

    What changes is the torque of a model's links. Positions enter through gravity, accelerations
    through inertia; speeds matter little.
    """
    noise = record.noise
    position = np.nan_to_num(_white(record, random, noise.position))
    drawn = _white(record, random, noise.velocity)
    measured = noise.measures_speed(record.bandwidth)
    velocity = np.where(measured, drawn, derivative(position, record.rate))
    acceleration = derivative(velocity, record.rate)
    given, at_rest = record.motion.position, np.zeros(position.shape)
    own, rows = record.robot.model, zip(given, position, strict=True)
    if own.nq == own.nv:  # coordinates are plain numbers
        shifted = given + position
    else:
        shifted = np.array([pin.integrate(own, q, error) for q, error in rows])

    def torque(model: pin.Model) -> FloatArray:
        there = inverse_dynamics(model, shifted, at_rest, acceleration)
        return there - inverse_dynamics(model, given, at_rest, at_rest)

    return acceleration, torque


def _needed(
    record: Record, torque: FloatArray, acceleration: FloatArray, sensed: FloatArray
) -> FloatArray:
    """Return noise (N, m + b + s) of what a model needs, of that in its links' torque (N, nv)."""
    robot, gears, balance = record.robot, record.robot.transmission, record.balance
    if balance is not None:
        torque = torque - balance.carried(torque[:, robot.unactuated])
    mesh = torque[:, robot.actuated] @ gears.topology
    behind = sensed - mesh[:, robot.sensed]
    mesh[:, robot.sensed] = sensed
    spin = acceleration[:, robot.actuated] @ gears.motor_from_joint.T
    needed = np.sign(gears.gear_ratio) * mesh + np.abs(gears.gear_ratio) * (
        gears.rotor_inertia * gears.gear_ratio * spin
    )
    seen = _seen(record, needed)
    return np.concatenate([-seen, -torque[:, robot.unactuated], behind], axis=1)


def load_bands(record: Record, noise: FloatArray) -> FloatArray:
    """Return (m,) the frequency [Hz] from which on the load of each driven joint is noise.

    Infinite where it is more than that in the whole band of the kinematics.

    Args:
        record: one log.
        noise: (N, m + b) of what the model needs, as drawn.
    """
    gears, robot = record.robot.transmission, record.robot
    load = (record.links - record.contacts)[:, robot.actuated] @ gears.topology
    length = min(len(load), max(16, int(record.rate / _RESOLUTION)))

    (frequency, signal), (_, drawn) = (
        welch(values, record.rate, nperseg=length, detrend="linear", axis=0)
        for values in (load, noise[:, : gears.size])
    )
    least = _LEAST * record.bandwidth.residual
    noisy = (signal < _MORE * drawn) & (frequency >= least)[:, None]
    noisy &= (frequency < record.bandwidth.kinematics)[:, None]
    first = frequency[np.argmax(noisy, axis=0)]
    return np.where(noisy.any(axis=0), np.maximum(first, least), np.inf)


def without_noise(record: Record, load: FloatArray, joint: str, frequency: float) -> FloatArray:
    """Return the load (N, nv) by which a link behind a soft gear is driven.

    A link that swings where its load is nothing but noise makes much of it: more than the filter
    of the residual takes away, so that fits would damp the swing.

    Args:
        record: one log.
        load: (N, nv) [N m, N].
        joint: in front of the link.
        frequency: at which the link swings [rad/s].
    """
    cutoff = float(record.load_band[record.robot.transmission.index(joint)])
    if frequency <= 2.0 * np.pi * cutoff:
        return load
    result, row = load.copy(), record.robot.velocity_index(joint)
    result[:, row] = low_pass(load[:, row], cutoff, record.rate, _STEEP)
    return result
