"""What an effect that only adds torque changes of the residual: without the rest of the robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.records.outputs import output_count
from wbc.identification.records.record import Record
from wbc.robot import Effect, Robot

ADDS: frozenset[str] = frozenset({"joint_torque", "joint_friction", "rotor_torque"})
"""Hooks by which an effect adds torque to what a robot needs, whatever else the robot has."""


def added_torque(robot: Robot, effect: Effect, record: Record) -> FloatArray | None:
    """Return (N, m + b + s) what an effect takes away from the residual, before weights.

    It holds beside any other effects as long as gears that feel it lose no share of what they
    carry, encoders are right, no link is simulated, and drives are perfect.

    Args:
        robot: that lacks the effect.
        effect: that only adds torque (`ADDS`).
        record: one log.

    Returns:
        None where contact forces were not measured: what carries the robot then depends on it.
    """
    if not effect.acts_by <= ADDS or record.balance is not None:
        return None
    motion, gears = record.motion, robot.transmission
    torque = np.zeros(motion.velocity.shape)
    pushed = effect.joint_torque(robot, motion)
    if pushed is not None:
        torque -= pushed
    dry = effect.joint_friction(robot, motion)
    if dry is not None:
        torque += dry * np.sign(motion.velocity)
    output = torque[:, robot.actuated] @ gears.topology
    sensors = output[:, robot.sensed]
    carried = np.array(output)
    carried[:, robot.sensed] = 0.0  # what sensors measure holds it already
    rotor = carried / gears.gear_ratio
    added = effect.rotor_torque(robot, motion)
    if added is not None:
        rotor = rotor - added
    driven = rotor * np.abs(gears.gear_ratio)
    return np.concatenate([driven, torque[:, robot.unactuated], sensors], axis=1)


def condensed(record: Record, values: FloatArray) -> FloatArray:
    """Return `values` (N, m + b + s) condensed (rows, m + b + s); outputs of zeros stay zero."""
    result = np.zeros((record.rows, values.shape[1]))
    for output in range(values.shape[1]):
        if values[:, output].any():  # mostly known from the first rows
            result[:, output] = record.condensed_at(values[:, [output]], output)[:, 0]
    return result


def added_column(robot: Robot, effect: Effect, records: Sequence[Record]) -> FloatArray | None:
    """Return (rows, m + b + s) what an effect takes away from the condensed residual of all logs.

    Arguments and None as in `added_torque`.
    """
    parts = []
    for record in records:
        values = added_torque(robot, effect, record)
        if values is None:
            return None
        parts.append(condensed(record, values))
    return np.concatenate(parts) if parts else np.zeros((0, output_count(robot)))
