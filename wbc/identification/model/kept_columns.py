"""Derivatives that do not depend on what else is in a model: computed once, used by many fits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import DynamicsError, EffectError, TransmissionError
from wbc.identification.model.added_torque import AddedTorque, added_torque, condensed
from wbc.identification.model.residual import condensed_residual
from wbc.identification.model.sparse_columns import SparseColumns
from wbc.identification.model.yielding import deflects
from wbc.identification.records.record import Record
from wbc.robot import Effect, Parameter, Robot

IMPOSSIBLE = (EffectError, TransmissionError, DynamicsError)
"""Raised where a robot cannot have an effect with these parameters."""

STEP = 1e-3
"""Share of a parameter's scale by which it is varied."""

_SAME = 1e-6  # share of a column by which rounding may change it
_MOST = 8  # columns kept of a parameter whose column depends on values

_Values = tuple[float, ...]
_Key = tuple[type[Effect], Parameter, tuple[object, ...], tuple[Effect, ...]]
_Asked = tuple[tuple[Effect, ...], Effect, Parameter]
"""What a column depends on beside its own effect, the effect, its parameter."""

Slots = Sequence[tuple[int, Parameter]]
"""Parameters as (number of effect, parameter)."""


@dataclass(frozen=True, eq=False)
class KeptColumns:
    """Derivatives (rows, m + b) of the residual of one robot on one set of logs.

    Where encoders are right and no link swings, what the motors must give is a sum of what the
    effects add, up to the gears that lose a share. A column that such gears do not feel depends
    on the parameters of its own effect alone (and on other effects that change the links, if it
    changes them, too). A column that is the same at two values of its effect, which has no shape,
    is the same at all. Columns are those of perfect drives.

    Attributes:
        robot: that lacks the effects.
        records: the logs.
    """

    robot: Robot
    records: tuple[Record, ...]
    _columns: dict[_Key, dict[_Values, SparseColumns]] = field(default_factory=dict)
    _constant: set[_Key] = field(default_factory=set)
    _last: dict[tuple[Effect, ...], FloatArray] = field(default_factory=dict)

    def columns(
        self, effects: Sequence[Effect], slots: Slots, among: Iterable[int]
    ) -> dict[int, SparseColumns]:
        """Return the change of the residual per scale of some parameters, by number of the slot.

        Without those that depend on more than their own effect.

        Args:
            effects: none of them acts on the motion.
            slots: parameters as (number of effect, parameter).
            among: numbers of the slots that are asked for.
        """
        found: dict[int, SparseColumns] = {}
        wanted: dict[int, tuple[_Key, _Asked]] = {}
        for row in among:
            k, parameter = slots[row]
            own = effects[k]
            try:
                beside = self._beside(effects, own, parameter)
            except IMPOSSIBLE:
                continue
            if beside is None:
                continue
            key = type(own), parameter, _what_it_is(own), beside
            known = self._columns.setdefault(key, {})
            if key in self._constant:
                found[row] = next(iter(known.values()))
                continue
            values = tuple(own.values.values())
            column = known.pop(values, None)
            if column is None:
                wanted[row] = key, (beside, own, parameter)
                continue
            found[row] = known[values] = column  # the one used last stands last
        made = self._made([asked for _, asked in wanted.values()])
        for (row, (key, (_, own, _))), column in zip(wanted.items(), made, strict=True):
            if column is not None:
                self._keep(key, own, column)
                found[row] = column
        return found

    def _keep(self, key: _Key, own: Effect, column: SparseColumns) -> None:
        known = self._columns[key]
        straight = not any(other.shape for other in own.parameters)
        if straight and any(_equal(column, other) for other in known.values()):
            self._constant.add(key)
        while len(known) >= _MOST:
            del known[next(iter(known))]
        known[tuple(own.values.values())] = column

    def _beside(
        self, effects: Sequence[Effect], own: Effect, parameter: Parameter
    ) -> tuple[Effect, ...] | None:
        """Return the effects that a column depends on beside its own, None if on all of them."""
        if own.acts_by & {"drive", "gear_efficiencies"}:
            return None
        if "change" not in own.acts_by:
            return ()
        robot = self.robot
        changed = _moved(own, parameter).change(robot)
        one, other = robot.transmission, changed.transmission
        if one is not other and not all(
            np.array_equal(getattr(one, name), getattr(other, name))
            for name in ("forward_efficiency", "backward_efficiency", "gear_ratio", "topology")
        ):
            return None
        if changed.model is robot.model:
            return ()
        changing = (e for e in effects if e is not own and "change" in e.acts_by)
        return tuple(e for e in changing if e.change(robot).model is not robot.model)

    def _made(self, asked: Sequence[_Asked]) -> list[SparseColumns | None]:
        """Return the columns of parameters, None where they cannot be moved.

        Those of effects that only add torque are filtered together.
        """
        result: list[SparseColumns | None] = [None] * len(asked)
        added: dict[int, list[AddedTorque]] = {}  # by number, one per log
        before: dict[Effect, list[AddedTorque] | None] = {}
        for number, (beside, own, parameter) in enumerate(asked):
            if own not in before:
                before[own] = self._added(own)
            here = before[own]
            if here is None:
                result[number] = self._by_difference(beside, own, parameter)
                continue
            for way in (STEP, -STEP):
                moved = _moved(own, parameter, (way,))
                there = None if moved is own else self._added(moved)
                if there is not None:
                    # What an effect adds is taken away from the residual.
                    pairs = zip(there, here, strict=True)
                    added[number] = [one.less(other, -1.0 / way) for one, other in pairs]
                    break
        parts = [
            condensed(record, [torques[k] for torques in added.values()])
            for k, record in enumerate(self.records)
        ]
        for number, *columns in zip(added, *parts, strict=True):
            result[number] = SparseColumns.stacked(columns)
        return result

    def _added(self, effect: Effect) -> list[AddedTorque] | None:
        """Return what an effect takes away from the residuals, None where it does not only add."""
        try:
            parts = [added_torque(self.robot, effect, record) for record in self.records]
        except IMPOSSIBLE:
            return None
        return [part for part in parts if part is not None] if None not in parts else None

    def _by_difference(
        self, beside: tuple[Effect, ...], own: Effect, parameter: Parameter
    ) -> SparseColumns | None:
        try:
            if (*beside, own) not in self._last:
                self._last.clear()
                self._last[*beside, own] = self._residual(beside, own)
            before = self._last[*beside, own]
            for way in (STEP, -STEP):
                moved = _moved(own, parameter, (way,))
                if moved is not own:
                    column = (self._residual(beside, moved) - before) / way
                    return SparseColumns.of(column[:, :, None])
        except IMPOSSIBLE:
            pass
        return None

    def _residual(self, beside: tuple[Effect, ...], own: Effect) -> FloatArray:
        """Return what is left with an effect, up to what does not depend on its numbers."""
        return condensed_residual(self.robot.with_effects(*beside, own), self.records)


def keeps_motion(robot: Robot) -> bool:
    """Whether no effect of a robot changes the motion that others act on, or simulates a link."""
    return not any(deflects(e) or "true" in e.acts_by for e in robot.effects)


def lossy_gears(robot: Robot) -> BoolArray:
    """Return (m,) which gears lose a share of what they carry."""
    gears = robot.transmission
    always = (gears.forward_efficiency != 1.0) | (gears.backward_efficiency != 1.0)
    return np.asarray(always | robot.varying_gears)


def _moved(effect: Effect, parameter: Parameter, ways: Sequence[float] = (STEP, -STEP)) -> Effect:
    """Return the effect with a parameter moved, itself if it cannot be."""
    value = effect.values[parameter.name]
    for way in ways:
        try:
            return effect.with_values({parameter.name: value + way * parameter.scale})
        except EffectError:
            continue
    return effect


def _what_it_is(effect: Effect) -> tuple[object, ...]:
    """Return all of an effect but its parameters: its place, and what a user's class adds."""
    numbers = {parameter.name for parameter in effect.parameters}
    return tuple(getattr(effect, f.name) for f in fields(effect) if f.name not in numbers)


def _equal(one: SparseColumns, other: SparseColumns) -> bool:
    if not np.array_equal(one.outputs, other.outputs):
        return False
    size = float(np.sum(one.values**2))
    return size > 0.0 and float(np.sum((one.values - other.values) ** 2)) < _SAME**2 * size
