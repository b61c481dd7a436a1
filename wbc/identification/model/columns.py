"""What a cause adds to the torque, and how that changes with its numbers: one column for each.

What links need is linear in their inertias. Other columns are differences of two residuals. What a
gear must give depends on its own mesh, rotor, drive and joint, not on those of others: changes at
several gears that do not share an output are made together, and each output shows its own (Curtis,
Powell, Reid, "On the estimation of sparse Jacobian matrices", 1974).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import inertial_parameters
from wbc.effects.drive import in_drive_order
from wbc.identification.model.residual import (
    IMPOSSIBLE,
    Asked,
    Evaluation,
    Slots,
    by_link_torque,
    raw_residual,
    swings_of,
    torques_of,
    with_changes,
)
from wbc.identification.model.yielding import deflects, loose, rubbing_at_link, some_deflect
from wbc.identification.records.record import Record, output_count, output_gear
from wbc.robot import Effect, Parameter, Robot

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
    def at(cls, outputs: IntArray, columns: FloatArray) -> SparseColumns:
        """Return what some outputs feel of columns (rows, outputs, r), without zeros.

        Nothing is shared with them.
        """
        felt = outputs[[bool(columns[:, output].any()) for output in outputs]]
        return cls(felt, columns[:, felt], columns.shape[1])

    @classmethod
    def beside(cls, parts: Sequence[SparseColumns]) -> SparseColumns:
        """Return the columns of several, one beside the other."""
        if len(parts) == 1:
            return parts[0]
        outputs = np.unique(np.concatenate([part.outputs for part in parts]))
        values = np.concatenate([part.full()[:, outputs] for part in parts], axis=2)
        return cls(outputs, values, parts[0].count)

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

    def at_rows(self, rows: IntArray | slice) -> SparseColumns:
        """Return some of the rows."""
        return replace(self, values=self.values[rows])

    def only(self, used: BoolArray) -> SparseColumns:
        """Return some of the columns, by used (r,)."""
        return self if used.all() else replace(self, values=self.values[:, :, used])


_IN_GEAR = frozenset({"drive", "drive_inverse", "meshed", "rotor_torque", "change"})
_AT_JOINT = frozenset({"joint_torque", "joint_friction"})
_PER_JOINT = ("gear_ratio", "topology")  # numbers of gears by which they share what links need


def outputs_of(robot: Robot, effect: Effect, records: Sequence[Record]) -> IntArray | None:
    """Return the numbers of the outputs that alone feel an effect, None where all may.

    Those of its gear, or of all gears that move its joint, and of sensors behind them.

    Args:
        robot: that lacks the effect.
        effect: that the robot can have.
        records: the logs.
    """
    gears = robot.transmission
    if effect.where not in gears.joints or not effect.acts_by <= _IN_GEAR | _AT_JOINT:
        return None
    # Contact forces that nobody measured follow from all gears; rotors that turn with links move
    # other joints.
    if robot.rotors_turn_with_links or any(record.balance is not None for record in records):
        return None
    changed = effect.change(robot)
    other = changed.transmission
    same = all(np.array_equal(getattr(gears, name), getattr(other, name)) for name in _PER_JOINT)
    if changed.model is not robot.model or not same:
        return None
    own = gears.index(effect.where)
    moving = np.flatnonzero(gears.topology[own]).tolist() if effect.acts_by & _AT_JOINT else [own]
    every = range(output_count(robot))
    return np.array([k for k in every if output_gear(robot, k) in moving], dtype=np.int_)


STEP = 1e-3
"""Share of a parameter's scale by which it is varied."""

# Share of its value by which a number is varied where links bounce: what they leave is smooth only
# from afar. A play 10 % too large stays where it is with 0.07 %; with 1 % a play 10 % too small is
# found to 1.4 %.
_ROUGH_STEP = 0.01
_UNFELT = 1e-4  # share of its neighbours below which a parameter is left where it is
_BATCH = 16  # columns filtered together; more only costs memory
# Slopes are differences by 1e-7 of the largest load: rounding leaves seven of their digits.
_STEADY, _DIGITS = 1e-6, 6


Known = Literal["asked", "loads", "nothing"]


@dataclass(frozen=True)
class Change:
    """One effect more, or in the place of the one with its name and place.

    Attributes:
        after: the effect.
        size: by which the change of the residual is divided.
        parameter: that alone is not as before; empty where the effect is one more.
    """

    after: Effect
    size: float
    parameter: str = ""


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of one robot on one set of logs.

    Attributes:
        robot: that lacks the effects.
        records: the logs.
    """

    robot: Robot
    records: tuple[Record, ...]

    def of(
        self, at: Evaluation, changes: Sequence[Change], *, held: bool
    ) -> list[SparseColumns | None]:
        """Return by how much each change moves the residual, over its size.

        Args:
            at: the robot with effects.
            changes: to one of them, or one more.
            held: whether links swing as before, whatever changes.

        Returns:
            None where the robot cannot be changed so. Not finite where a link flies off.
        """
        found = self._inertial(at, changes, held)
        others = {k: change for k, change in enumerate(changes) if k not in found}
        found.update(self._by_difference(at, others, held))
        return [found.get(k) for k in range(len(changes))]

    def _whole(self, at: Evaluation, changes: Iterable[Change]) -> Robot:
        """Return the robot with its effects and some changes.

        Raises:
            EffectError, TransmissionError: it cannot have them.
        """
        effects = {effect.key: effect for effect in at.effects}
        effects |= {change.after.key: change.after for change in changes}
        if any("change" in change.after.acts_by for change in changes):
            return self.robot.with_effects(*in_drive_order(effects.values()))
        # Every number that effects change is as it was.
        return at.robot.with_acting((*self.robot.effects, *in_drive_order(effects.values())))

    def _inertial(
        self, at: Evaluation, changes: Sequence[Change], held: bool
    ) -> dict[int, SparseColumns | None]:
        """Return the columns of changes to the links' inertias, by number."""
        only: dict[type[Effect], bool] = {}
        links = {e.key: e for e in at.effects if e.change(self.robot).model is not self.robot.model}
        before: dict[tuple[Effect, ...], FloatArray] = {}
        found: dict[int, SparseColumns | None] = {}
        moved: dict[int, FloatArray] = {}
        for k, change in enumerate(changes):
            effect = change.after
            if "change" not in effect.acts_by:
                continue
            if not held and some_deflect(at.effects) and not effect.search.drawn:
                continue  # how links swing depends on their inertias
            try:
                if type(effect) not in only:
                    only[type(effect)] = only_inertial(self.robot, effect)
                if not only[type(effect)]:
                    continue
                # What changes other bodies does so before and after.
                near = {
                    key: e
                    for key, e in links.items()
                    if e.where == effect.where or "robot" in (e.where, effect.where)
                }
                if (own := tuple(near.values())) not in before:
                    before[own] = inertial_parameters(self.robot.with_effects(*own))
                changed = self.robot.with_effects(*(near | {effect.key: effect}).values())
                moved[k] = (inertial_parameters(changed) - before[own]) / change.size
            except IMPOSSIBLE:
                found[k] = None
        if not moved:
            return found
        along = np.stack(list(moved.values()), axis=-1)
        whole = inertial_columns(at.robot, at.records, at.swinging, along)
        found.update(
            (k, SparseColumns.at(np.arange(whole.shape[1]), whole[:, :, [n]]))
            for n, k in enumerate(moved)
        )
        return found

    def _by_difference(
        self,
        at: Evaluation,
        changes: Mapping[int, Change],
        held: bool,
    ) -> dict[int, SparseColumns | None]:
        """Return the columns of changes as differences of residuals, by number.

        Args:
            at: the robot with effects.
            changes: by number.
            held: as of `of`.
        """
        found: dict[int, SparseColumns | None] = {}
        felt: dict[int, IntArray | None] = {}
        robots: dict[int, Robot] = {}
        bends = not held and some_deflect(at.effects)
        for k, change in changes.items():
            try:
                robots[k] = self._whole(at, [change])
                felt[k] = None if bends else outputs_of(self.robot, change.after, at.records)
            except IMPOSSIBLE:
                found[k] = None
        groups = self._groups(at, changes, robots, felt, bends)
        bent = {k for k in felt if bends and self.swings(at, changes[k].after)}
        ahead = self._ahead(at) if bent else []
        for first in range(0, len(groups), _BATCH):
            several, parts = groups[first : first + _BATCH], []
            for group, known in several:
                one, together = group[0], [changes[k] for k in group]
                changed = robots[one] if len(group) == 1 else self._whole(at, together)
                moved = self._moved(at, changed, known)
                parts.append(self._bent(at, changed, ahead) if one in bent else list(moved))
            whole = np.concatenate(
                [
                    record.condense(np.stack([own[log] for own in parts], axis=-1))
                    for log, record in enumerate(at.records)
                ]
            )
            for place, (group, _) in enumerate(several):
                for k in group:
                    outputs = felt[k]
                    every = np.arange(whole.shape[1]) if outputs is None else outputs
                    own = SparseColumns.at(every, whole[:, :, [place]])
                    found[k] = replace(own, values=own.values / changes[k].size)
        return found

    def _groups(
        self,
        at: Evaluation,
        changes: Mapping[int, Change],
        robots: Mapping[int, Robot],
        felt: dict[int, IntArray | None],
        bends: bool,
    ) -> list[tuple[list[int], Known]]:
        """Return which changes are made together, and what stays as it is while they are.

        People write effects of their own: where other outputs feel one, all do in `felt`.

        Args:
            at: the robot with effects.
            changes: by number.
            robots: with each.
            felt: the outputs that alone feel each.
            bends: whether links may swing otherwise.
        """
        alone: dict[int, Known] = {}
        shared: dict[Known, dict[int, IntArray]] = {"asked": {}, "loads": {}}
        judged: dict[type[Effect], bool] = {}
        for k, outputs in felt.items():
            effect = changes[k].after
            within: Known = "asked" if effect.acts_by <= _IN_GEAR else "loads"
            if outputs is not None and type(effect) not in judged:
                moved = np.delete(next(self._moved(at, robots[k], within)), outputs, axis=1)
                judged[type(effect)] = not np.any(moved)
            if outputs is not None and judged[type(effect)]:
                shared[within][k] = outputs
            else:
                alone[k] = "loads" if effect.acts_by <= ADDS and not bends else "nothing"
        felt |= dict.fromkeys(alone)
        groups = [(group, known) for known, own in shared.items() for group in _disjoint(own)]
        return [*groups, *(([k], known) for k, known in alone.items())]

    def _moved(self, at: Evaluation, whole: Robot, known: Known) -> Iterator[FloatArray]:
        """Yield per record (N, m + b) what changes move, links swinging as before.

        Args:
            at: the robot with effects.
            whole: the same with changes.
            known: what stays as it is: what the motion asks of the gears, the loads of the links
                and contacts, or nothing.
        """
        each = zip(at.records, at.raw, at.swinging, at.asked, strict=True)
        for record, before, swinging, asked in each:
            try:
                if asked is not None and known == "loads":
                    asked = Asked.of(whole, asked.motion, asked.links, asked.contacts)
                left = raw_residual(whole, record, swinging, asked if known != "nothing" else None)
                yield left - before
            except IMPOSSIBLE:
                yield np.full_like(before, np.nan)

    def _bent(self, at: Evaluation, whole: Robot, ahead: Sequence[FloatArray]) -> list[FloatArray]:
        """Return per record (N, m + b) what a change moves with how links swing, from `ahead`."""
        try:
            after = self._ahead(at, whole)
        except IMPOSSIBLE:
            after = [np.full_like(one, np.nan) for one in ahead]
        return [one - other for one, other in zip(after, ahead, strict=True)]

    def _ahead(self, at: Evaluation, robot: Robot | None = None) -> list[FloatArray]:
        """Return per record (N, m + b) what a robot close to that of `at` leaves, straight on."""
        robot = robot or at.robot
        near = torques_of(swings_of(robot, at.records, at, straight=True))
        pairs = zip(at.records, near, strict=True)
        return [raw_residual(robot, record, torque) for record, torque in pairs]

    def swings(self, at: Evaluation, own: Effect) -> bool:
        """Whether the parameters of an effect change how links swing behind their gears.

        What is no part of a soft gear nor of a link, nor rubs there, hardly does. The ten numbers
        of every link of a drawing do together: a fit finds them with the swing as it is, step by
        step.
        """
        if deflects(own):
            return True
        if own.search.drawn:
            return False
        behind_gears = [effect.where for effect in at.effects if deflects(effect)]
        motion = at.records[0].motion
        if own.where in behind_gears:
            rubbing = rubbing_at_link(at.robot, own.where, motion)
            if own.key in {effect.key for effect in rubbing}:
                return True
        return bool(behind_gears) and own.change(self.robot).model is not self.robot.model


def derivatives(
    columns: Columns,
    at: Evaluation,
    slots: Slots,
    whitening: FloatArray,
    known: Mapping[int, FloatArray],
) -> FloatArray:
    """Return the change (rows, outputs, p) of the residual per scale of each parameter.

    Args:
        columns: of the robot that lacks the effects.
        at: where.
        slots: the p parameters as (number of effect, parameter).
        whitening: (outputs, judged outputs) by which residuals are multiplied.
        known: (rows, outputs) derivatives nearby, by the number of the parameter; they are taken.
    """
    if not slots:
        return np.zeros((*at.residual.shape, 0))
    # One column after the other: each is written, and read again, as a whole.
    result = np.zeros((len(slots), *at.residual.shape))
    for row, nearby in known.items():
        result[row] = nearby
    waiting = set(range(len(slots))) - known.keys()
    for way in (1.0, -1.0):
        rows = sorted(waiting)
        steps = {row: _step(at, *slots[row], way) for row in rows}
        asked = {row: step for row, step in steps.items() if step is not None}
        found = columns.of(at, list(asked.values()), held=False)
        for row, column in zip(asked, found, strict=True):
            if column is not None and column.finite:
                result[row] = column.whitened(whitening)[:, :, 0]
                waiting.discard(row)
    size = np.array([np.linalg.norm(column) for column in result])
    owners = np.array([k for k, _ in slots])
    beside = np.zeros(owners.max() + 1)
    np.maximum.at(beside, owners, size)
    result[size < _UNFELT * beside[owners]] = 0.0
    return np.moveaxis(result, 0, -1)


def change_along(jacobian: FloatArray, step: FloatArray) -> FloatArray:
    """Return what a step (p,) changes (rows, outputs), by derivatives (rows, outputs, p)."""
    rows, outputs, count = jacobian.shape
    return np.asarray((jacobian.reshape(rows * outputs, count) @ step).reshape(rows, outputs))


def _step(at: Evaluation, k: int, parameter: Parameter, way: float) -> Change | None:
    """Return a small change of a parameter of effect `k`, None where it cannot have it."""
    own, width = at.effects[k], STEP
    if loose(at.effects) and deflects(own):
        width = max(STEP, _ROUGH_STEP * abs(own.values[parameter.name]) / parameter.scale)
    change = {(k, parameter.name): way * width * parameter.scale}
    try:
        return Change(with_changes(at.effects, change)[k], way * width, parameter.name)
    except IMPOSSIBLE:
        return None


def only_inertial(robot: Robot, effect: Effect) -> bool:
    """Whether an effect changes the inertias of the links and nothing else."""
    if effect.acts_by != {"change"}:
        return False
    changed = effect.change(robot)
    same_field = np.array_equal(changed.model.gravity.linear, robot.model.gravity.linear)
    same_gears = changed.transmission is robot.transmission
    return same_field and same_gears and changed.contacts is robot.contacts


def inertial_columns(
    robot: Robot,
    records: Sequence[Record],
    swinging: Sequence[FloatArray | None],
    changes: FloatArray,
) -> FloatArray:
    """Return (rows, m + b, p) the change of the residual with the links' parameters.

    What the links need is linear in their parameters, Y theta; what a gear that loses a share makes
    of it is differentiated at every sample.

    Args:
        robot: with its effects; none of its links swings with these parameters.
        records: the logs.
        swinging: torque of `swing_of`, of each record.
        changes: (10 n_links, p) of the parameters.
    """
    parts = []
    for record, held in zip(records, swinging, strict=True):
        slope, moved = by_link_torque(robot, record, held)
        outputs = [_at_output(moved, k, slope[:, k], changes) for k in range(slope.shape[1])]
        parts.append(np.stack(outputs, axis=1))
    return np.concatenate(parts)


def _at_output(record: Record, output: int, slope: FloatArray, changes: FloatArray) -> FloatArray:
    """Return the columns (rows, p) at one output, of which `slope` (N, nv) is the derivative.

    Where nothing loses a share of the load the slope is the same at every sample. Then the columns
    are sums of those of the links' parameters, which are kept whatever else the robot has.
    """
    mean = slope.mean(axis=0)
    size = float(np.max(np.abs(mean), initial=0.0))
    if size > 0.0 and np.max(np.abs(slope - mean)) < _STEADY * size:
        direction = np.round(mean / size, _DIGITS) + 0.0
        return np.asarray(record.condensed_regressor(output, direction) @ (size * changes))
    felt = np.flatnonzero(slope.any(axis=0))
    used = np.any(changes, axis=1) & np.any(record.felt[felt], axis=0)
    if not used.any():
        return np.zeros((record.rows, changes.shape[1]))
    columns = np.einsum("ni,nip->np", slope[:, felt], record.regressor[:, felt][..., used])
    condensed = record.condensed_at(np.ascontiguousarray(columns), output)
    return np.asarray(condensed @ changes[used])


def _disjoint(felt: Mapping[int, IntArray]) -> list[list[int]]:
    """Return groups of columns of which no two are felt by one output."""
    groups: list[tuple[set[int], list[int]]] = []
    for row, outputs in felt.items():
        own = set(outputs.tolist())
        for taken, rows in groups:
            if not own & taken:
                taken |= own
                rows.append(row)
                break
        else:
            groups.append((own, [row]))
    return [rows for _, rows in groups]
