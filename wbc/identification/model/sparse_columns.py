"""Columns that few outputs feel, and effects that one gear alone feels.

What a gear must give depends on its own mesh, rotor and drive, not on those of others. Changes at
several gears that do not share an output are therefore made together, and each output shows its
own (Curtis, Powell, Reid, "On the estimation of sparse Jacobian matrices", 1974).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.identification.records.record import Record, output_count, output_gear
from wbc.robot import Effect, Robot


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
        """Return the columns with each output divided by its size (outputs,)."""
        return replace(self, values=self.values / sizes[self.outputs, None])

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
