"""Columns that few outputs feel: of effects that one gear alone feels, or that only add torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.identification.records.record import Record, output_count, output_gear
from wbc.robot import Effect, Robot

ADDS: frozenset[str] = frozenset({"joint_torque", "joint_friction", "rotor_torque"})
"""Hooks by which an effect adds torque to what a robot needs, whatever else the robot has."""


@dataclass(frozen=True, eq=False)
class SparseColumns:
    """Columns (rows, outputs, r) of a regression without the outputs at which all are zero.

    Most causes act at one joint: of a quadruped's 18 outputs one feels them.

    Attributes:
        outputs: (k,) numbers of the outputs that feel them.
        values: (rows, k, r).
        count: of all outputs.
    """

    outputs: IntArray
    values: FloatArray
    count: int

    @classmethod
    def of(cls, columns: FloatArray) -> SparseColumns:
        """Return columns (rows, outputs, r) without zeros; nothing is shared with them."""
        return cls.at(np.arange(columns.shape[1]), columns)

    @classmethod
    def at(cls, outputs: IntArray, columns: FloatArray) -> SparseColumns:
        """Return what some outputs feel of columns (rows, outputs, r), without zeros."""
        felt = outputs[[bool(columns[:, output].any()) for output in outputs]]
        return cls(felt, columns[:, felt], columns.shape[1])

    @classmethod
    def stacked(cls, parts: Sequence[SparseColumns]) -> SparseColumns:
        """Return the rows of several logs, one after the other."""
        return cls._joined(parts, axis=0)

    @classmethod
    def beside(cls, parts: Sequence[SparseColumns]) -> SparseColumns:
        """Return the columns of several, one beside the other."""
        return cls._joined(parts, axis=2)

    @classmethod
    def _joined(cls, parts: Sequence[SparseColumns], axis: int) -> SparseColumns:
        if len(parts) == 1:
            return parts[0]
        outputs = np.unique(np.concatenate([part.outputs for part in parts]))
        values = np.concatenate([part.full()[:, outputs] for part in parts], axis=axis)
        return cls(outputs, values, parts[0].count)

    def over(self, sizes: FloatArray) -> SparseColumns:
        """Return the columns with each output divided by its sizes (rows, outputs)."""
        return replace(self, values=self.values / sizes[:, self.outputs, None])

    @cached_property
    def finite(self) -> bool:
        """Whether all values are numbers."""
        return bool(np.isfinite(self.values).all())

    @cached_property
    def sizes(self) -> FloatArray:
        """(r,) root mean squares over all rows and outputs."""
        squares = np.sum(self.values**2, axis=(0, 1))
        return np.asarray(np.sqrt(squares / (len(self.values) * self.count)))

    def full(self) -> FloatArray:
        """Return the columns (rows, outputs, r)."""
        result = np.zeros((len(self.values), self.count, self.values.shape[2]))
        result[:, self.outputs] = self.values
        return result

    def whitened(self, whitening: FloatArray) -> FloatArray:
        """Return the columns (rows, judged outputs, r) in floors.

        Args:
            whitening: (outputs, judged outputs).
        """
        return np.asarray(whitening[self.outputs].T @ self.values)

    def at_rows(self, rows: IntArray) -> SparseColumns:
        """Return some of the rows, by their numbers."""
        return replace(self, values=self.values[rows])

    def only(self, used: BoolArray) -> SparseColumns:
        """Return some of the columns, by used (r,)."""
        return self if used.all() else replace(self, values=self.values[:, :, used])


_AT_GEAR = frozenset(
    {"drive", "drive_inverse", "gear_efficiencies", "meshed", "rotor_torque", "change"}
)
_PER_JOINT = ("gear_ratio", "topology")  # numbers of gears by which they share what links need


def own_gear(robot: Robot, effect: Effect, records: Sequence[Record]) -> int | None:
    """Return the number of the gear that alone feels an effect, None where more may.

    Args:
        robot: that lacks the effect.
        effect: that the robot can have.
        records: the logs.
    """
    if effect.where not in robot.transmission.joints or not effect.acts_by <= _AT_GEAR:
        return None
    # Contact forces that nobody measured follow from all gears; rotors that turn with links move
    # other joints.
    if robot.rotors_turn_with_links or any(record.balance is not None for record in records):
        return None
    changed = effect.change(robot)
    if changed.model is not robot.model:
        return None
    one, other = robot.transmission, changed.transmission
    if not all(np.array_equal(getattr(one, name), getattr(other, name)) for name in _PER_JOINT):
        return None
    return one.index(effect.where)


def outputs_of(robot: Robot, gear: int) -> IntArray:
    """Return the numbers of the outputs of a gear: its own, and that of a sensor behind it."""
    every = range(output_count(robot))
    return np.array([k for k in every if output_gear(robot, k) == gear], dtype=np.int_)


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

    def times(self, factor: float) -> AddedTorque:
        """Return a multiple."""
        return AddedTorque(self.outputs, factor * self.values, self.count)

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
