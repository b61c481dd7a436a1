"""The noise floor: what the residual of a perfect model would still be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque
from wbc.identification.record import Record
from wbc.identification.smoothing import low_pass

_SAME_MOTION = 0.02  # of the range of motion: runs closer than this are repeats of one another


@dataclass(frozen=True, eq=False)
class NoiseFloor:
    """Root mean square of the residual that noise alone leaves.

    Attributes:
        values: (m + b,) per output [N m, N].
        sensors: (m + b,) what the white noise of the sensors explains, a lower bound.
        repeats: pairs of record numbers that repeat one another; with none, `values` is the
            lower bound.
    """

    values: FloatArray
    sensors: FloatArray
    repeats: tuple[tuple[int, int], ...]

    @property
    def source(self) -> str:
        """`repeats` or `lower bound`."""
        return "repeats" if self.repeats else "lower bound"


def noise_floor(records: Sequence[Record], residuals: Sequence[FloatArray]) -> NoiseFloor:
    """Return the floor from repeated runs where there are any, else from the sensors' noise.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each.
    """
    sensors = np.sqrt(np.mean([np.mean(_synthetic(r) ** 2, axis=0) for r in records], axis=0))
    pairs = find_repeats(records)
    if not pairs:
        return NoiseFloor(sensors, sensors, ())
    squares = [np.mean((residuals[i] - residuals[j]) ** 2, axis=0) / 2.0 for i, j in pairs]
    return NoiseFloor(np.sqrt(np.mean(squares, axis=0)), sensors, pairs)


def find_repeats(records: Sequence[Record]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of records that went through the same motion (and are not copies)."""
    pairs = []
    for i, first in enumerate(records):
        for j in range(i + 1, len(records)):
            second = records[j]
            if first.motion.position.shape != second.motion.position.shape:
                continue
            spread = np.ptp(first.motion.velocity, axis=0)
            moving = spread > 0.0
            distance = first.motion.velocity - second.motion.velocity
            apart = np.sqrt(np.mean(distance**2, axis=0))[moving] / spread[moving]
            copies = np.array_equal(first.torque, second.torque)
            if apart.size and apart.max() < _SAME_MOTION and not copies:
                pairs.append((i, j))
    return tuple(pairs)


def _synthetic(record: Record) -> FloatArray:
    """Return the residual (rows, m + b) that white sensor noise of the measured level makes."""
    robot, rate, noise = record.robot, record.rate, record.noise
    random = np.random.default_rng(0)
    count, nv = record.motion.velocity.shape
    cutoff = record.bandwidth.kinematics

    def white(level: FloatArray) -> FloatArray:
        sigma = np.sqrt(np.maximum(np.nan_to_num(level), 0.0) * 0.5 * rate)
        draws = sigma * random.standard_normal((count, level.size))
        return low_pass(draws, cutoff, rate)

    by_position, by_velocity = noise.acceleration_variance(record.bandwidth.residual)
    quieter = by_velocity < np.where(np.isfinite(by_position), by_position, np.inf)
    velocity = np.where(
        quieter, white(noise.velocity), np.gradient(white(noise.position), 1.0 / rate, axis=0)
    )
    acceleration = np.gradient(velocity, 1.0 / rate, axis=0)
    torque = np.empty((count, nv))
    data = robot.model.createData()
    for row, q in enumerate(record.motion.position):
        mass = pin.crba(robot.model, data, q)
        torque[row] = mass @ acceleration[row]
    forces = {name: white(level) for name, level in noise.forces.items()}
    torque -= contact_torque(robot, record.motion.position, forces)
    gears = robot.transmission
    mesh = torque[:, robot.actuated] @ gears.topology
    spin = acceleration[:, robot.actuated] @ gears.motor_from_joint.T
    driven = white(noise.torque) - mesh - gears.reflected_inertia * spin
    return record.condense(np.concatenate([driven, torque[:, robot.unactuated]], axis=1))
