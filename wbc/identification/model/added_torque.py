"""What an effect that only adds torque changes of the residual: without the rest of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.sparse_columns import SparseColumns
from wbc.identification.records.record import Record, output_count
from wbc.robot import Effect, Robot

ADDS: frozenset[str] = frozenset({"joint_torque", "joint_friction", "rotor_torque"})
"""Hooks by which an effect adds torque to what a robot needs, whatever else the robot has."""


@dataclass(frozen=True, eq=False)
class AddedTorque:
    """What is taken away from the residual of one log, before weights.

    Attributes:
        outputs: (k,) numbers of the outputs that feel it, in order.
        values: (N, k).
        count: of all outputs.
    """

    outputs: IntArray
    values: FloatArray
    count: int

    def less(self, other: AddedTorque, factor: float) -> AddedTorque:
        """Return `factor` times the difference to another one."""
        outputs = np.union1d(self.outputs, other.outputs)
        values = self._at(outputs) - other._at(outputs)
        values *= factor
        return AddedTorque(outputs, values, self.count)

    def _at(self, outputs: IntArray) -> FloatArray:
        if np.array_equal(outputs, self.outputs):
            return self.values
        result = np.zeros((len(self.values), outputs.size))
        result[:, np.searchsorted(outputs, self.outputs)] = self.values
        return result


def added_torque(robot: Robot, effect: Effect, record: Record) -> AddedTorque | None:
    """Return what an effect takes away from the residual of a log.

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
    gears, felt = robot.transmission, _at_joints(robot, effect, record)
    outputs: dict[int, FloatArray] = {}
    driven = {int(row): k for k, row in enumerate(robot.actuated)}
    places = {int(k): gears.size + robot.floating_size + s for s, k in enumerate(robot.sensed)}
    for row, torque in felt.items():
        if row not in driven:
            k = gears.size + int(np.flatnonzero(robot.unactuated == row)[0])
            outputs[k] = torque
            continue
        shares = gears.topology[driven[row]]
        for k in np.flatnonzero(shares).tolist():
            # What a sensor behind a gear measures holds it already: the gear's row does not.
            place, sign = (places[k], 1.0) if k in places else (k, np.sign(gears.gear_ratio[k]))
            own = sign * shares[k] * torque
            outputs[place] = outputs[place] + own if place in outputs else own
    for k, added in _felt(effect.rotor_torque(robot, record.motion)):
        own = added * np.abs(gears.gear_ratio[k])
        outputs[k] = outputs[k] - own if k in outputs else -own
    values = np.empty((len(record.torque), len(outputs)))
    order = sorted(outputs)
    for column, k in enumerate(order):
        values[:, column] = outputs[k]
    return AddedTorque(np.array(order, dtype=np.int_), values, output_count(robot))


def _at_joints(robot: Robot, effect: Effect, record: Record) -> dict[int, FloatArray]:
    """Return what the joints need more (N,), by row of v; rows that feel nothing are left out."""
    motion = record.motion
    felt = {row: -torque for row, torque in _felt(effect.joint_torque(robot, motion))}
    for row, level in _felt(effect.joint_friction(robot, motion)):
        rubbed = level * np.sign(motion.velocity[:, row])
        felt[row] = felt[row] + rubbed if row in felt else rubbed
    return felt


def _felt(torque: FloatArray | None) -> list[tuple[int, FloatArray]]:
    """Return the columns (N,) of an array (N, k) that are not all zero, with their numbers."""
    if torque is None:
        return []
    power = np.einsum("nk,nk->k", torque, torque)  # a fourth of the time of `any`
    return [(int(k), torque[:, k]) for k in np.flatnonzero(power != 0.0)]


def condensed(record: Record, torques: Sequence[AddedTorque]) -> list[SparseColumns]:
    """Return what several effects take away from the condensed residual, one column for each.

    All are filtered at once: sixteen columns take hardly longer than one.
    """
    if not torques:
        return []
    outputs = np.concatenate([torque.outputs for torque in torques])
    values = np.concatenate([torque.values for torque in torques], axis=1)
    found = record.condensed_columns(values, outputs)
    felt = np.einsum("rk,rk->k", found, found) != 0.0
    result, first = [], 0
    for torque in torques:
        own = slice(first, first + torque.outputs.size)
        first = own.stop
        kept = torque.outputs[felt[own]]
        result.append(SparseColumns(kept, found[:, own][:, felt[own], None], torque.count))
    return result
