"""What a cause adds to the torque, and how that changes with its numbers: one column for each.

What links need is linear in their inertias, and what only adds torque adds it whatever else the
robot has; a gear that loses a share of its load passes both on by one slope at every sample. Other
columns are differences of two residuals. What a gear must give depends on its own mesh, rotor and
drive, not on those of others: changes at several gears that do not share an output are made
together, and each output shows its own (Curtis, Powell, Reid, "On the estimation of sparse Jacobian
matrices", 1974).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import inertial_parameters
from wbc.identification.model.residual import (
    IMPOSSIBLE,
    Evaluation,
    Slots,
    by_link_torque,
    mesh_slopes,
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

    def at_rows(self, rows: IntArray | slice) -> SparseColumns:
        """Return some of the rows."""
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


def added_torque(
    robot: Robot, effect: Effect, record: Record, slopes: FloatArray | None = None
) -> dict[int, FloatArray] | None:
    """Return what an effect takes away (N,) from the residual of a log, by number of the output.

    It holds beside any other effects as long as no link is simulated, and drives are perfect.

    Args:
        robot: that lacks the effect.
        effect: that only adds torque (`ADDS`).
        record: one log, along the true motion.
        slopes: (N, m) torque of the motors per torque at the outputs of their gears, None where
            none loses a share of it.

    Returns:
        Before weights, without outputs that feel nothing. None where contact forces were not
        measured: what carries the robot then depends on it.
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
            if slopes is not None and k not in places:
                own = own * slopes[:, k]
            outputs[place] = outputs[place] + own if place in outputs else own
    for k, added in _felt(effect.rotor_torque(robot, record.motion)):
        own = added * np.abs(gears.gear_ratio[k])
        outputs[k] = outputs[k] - own if k in outputs else -own
    return outputs


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


def _less(
    one: Mapping[int, FloatArray], other: Mapping[int, FloatArray], size: float
) -> dict[int, FloatArray]:
    """Return by how much one is more than another, over a size; what is absent is zero."""
    zero = np.zeros(1)
    return {k: (one.get(k, zero) - other.get(k, zero)) / size for k in one.keys() | other.keys()}


def condensed(record: Record, torques: Sequence[Mapping[int, FloatArray]]) -> list[SparseColumns]:
    """Return what several effects take away from the condensed residual, one column for each.

    All are filtered at once: sixteen columns take hardly longer than one.

    Args:
        record: one log.
        torques: what each takes away (N,), by number of the output.
    """
    pairs = [pair for torque in torques for pair in sorted(torque.items())]
    outputs = np.array([output for output, _ in pairs], dtype=np.int_)
    values = np.empty((len(record.torque), outputs.size))
    for column, (_, own) in enumerate(pairs):
        values[:, column] = own
    found = record.condense_driven(values * record.scale[:, outputs])
    felt = np.einsum("rk,rk->k", found, found) != 0.0
    count, result = output_count(record.robot), []
    for first, end in pairwise(np.cumsum([0, *map(len, torques)])):
        own = first + np.flatnonzero(felt[first:end])
        result.append(SparseColumns(outputs[own], found[:, own, None], count))
    return result


STEP = 1e-3
"""Share of a parameter's scale by which it is varied."""

# Share of its value by which a number is varied where links bounce: what they leave is smooth only
# from afar. A play 10 % too large stays where it is with 0.07 %; with 1 % a play 10 % too small is
# found to 1.4 %.
_ROUGH_STEP = 0.01
_UNFELT = 1e-4  # share of its neighbours below which a parameter is left where it is
_BATCH = 64  # columns filtered together; more only costs memory
# Slopes are differences by 1e-7 of the largest load: rounding leaves seven of their digits.
_STEADY, _DIGITS = 1e-6, 6


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
        adding = {k: c for k, c in enumerate(changes) if c.after.acts_by <= ADDS}
        if adding and not some_deflect(at.robot.effects):
            found |= self._along(at)._adding(at, adding)
        others = {k: change for k, change in enumerate(changes) if k not in found}
        found.update(self._by_difference(at, others, held))
        return [found.get(k) for k in range(len(changes))]

    def _along(self, at: Evaluation) -> Columns:
        """Return the columns along the motion that the robot takes for true."""
        motions = [None if asked is None else asked.motion for asked in at.asked]
        pairs = list(zip(self.records, motions, strict=True))
        if all(motion is None or motion is record.motion for record, motion in pairs):
            return self
        along = (record if motion is None else record.along(motion) for record, motion in pairs)
        return Columns(self.robot, tuple(along))

    def _whole(self, at: Evaluation, changes: Iterable[Change]) -> Robot:
        """Return the robot with its effects and some changes.

        Raises:
            EffectError, TransmissionError: it cannot have them.
        """
        effects = {effect.key: effect for effect in at.effects}
        effects |= {change.after.key: change.after for change in changes}
        if any("change" in change.after.acts_by for change in changes):
            return self.robot.with_effects(*effects.values())
        # Every number that effects change is as it was.
        return at.robot.with_acting((*self.robot.effects, *effects.values()))

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
            if not held and some_deflect(at.effects) and not drawn(effect):
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
        found.update((k, SparseColumns.of(whole[:, :, [n]])) for n, k in enumerate(moved))
        return found

    def _adding(self, at: Evaluation, changes: Mapping[int, Change]) -> dict[int, SparseColumns]:
        """Return the columns of what only adds torque, by number; those that do more are left out.

        Arguments as those of `of`, the changes by number.
        """
        slopes = [
            None if asked is None else mesh_slopes(at.robot, record, asked.output)
            for record, asked in zip(self.records, at.asked, strict=True)
        ]
        parts: dict[int, list[dict[int, FloatArray]]] = {}
        here: dict[Effect, list[dict[int, FloatArray]] | None] = {}
        known = {effect.key: effect for effect in at.effects}
        for k, change in changes.items():
            there = self._adds(change.after, slopes)
            if there is None:
                continue
            if change.parameter:
                own = known[change.after.key]
                if own not in here:
                    here[own] = self._adds(own, slopes)
                if (less := here[own]) is None:
                    continue
                parts[k] = [_less(*pair, change.size) for pair in zip(less, there, strict=True)]
            else:
                parts[k] = [_less({}, own, change.size) for own in there]
        return {k: column.over(at.sizes) for k, column in self._filtered(parts).items()}

    def _adds(
        self, effect: Effect, slopes: Sequence[FloatArray | None]
    ) -> list[dict[int, FloatArray]] | None:
        """Return what an effect takes away from the residuals, None where it does not only add."""
        pairs = zip(self.records, slopes, strict=True)
        try:
            parts = [added_torque(self.robot, effect, record, own) for record, own in pairs]
        except IMPOSSIBLE:
            return None
        return [part for part in parts if part is not None] if None not in parts else None

    def _filtered(
        self, parts: Mapping[int, Sequence[Mapping[int, FloatArray]]]
    ) -> dict[int, SparseColumns]:
        found: dict[int, SparseColumns] = {}
        numbers = list(parts)
        for first in range(0, len(numbers), _BATCH):
            batch = numbers[first : first + _BATCH]
            each = [
                condensed(record, [parts[k][log] for k in batch])
                for log, record in enumerate(self.records)
            ]
            for k, *columns in zip(batch, *each, strict=True):
                found[k] = SparseColumns.stacked(columns)
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
        alone: dict[int, IntArray] = {}
        gears: set[int] = set()
        rest: list[int] = []
        judged: dict[type[Effect], bool] = {}
        robots: dict[int, Robot] = {}
        bends = not held and some_deflect(at.effects)
        for k, change in changes.items():
            effect = change.after
            try:
                robots[k] = self._whole(at, [change])
                gear = None if bends else own_gear(self.robot, effect, at.records)
            except IMPOSSIBLE:
                found[k] = None
                continue
            if gear is not None and type(effect) not in judged:
                judged[type(effect)] = self._one_gear_feels(at, robots[k], gear)
            if gear is not None and judged[type(effect)]:
                alone[k] = outputs_of(self.robot, gear)
                gears.add(k)
            else:
                rest.append(k)
        groups = _disjoint(alone)
        bent = {k for k in rest if bends and self.swings(at, changes[k].after)}
        ahead = self._ahead(at) if bent else []
        for first in range(0, len(groups) + len(rest), _BATCH):
            several = [*groups, *([k] for k in rest)][first : first + _BATCH]
            moved = []
            for group in several:
                one, together = group[0], [changes[k] for k in group]
                changed = robots[one] if len(group) == 1 else self._whole(at, together)
                if one in bent:
                    moved.append(self._bent(at, changed, ahead))
                else:
                    moved.append(self._moved(at, changed, gears.issuperset(group)))
            whole = np.concatenate(
                [
                    record.condense(np.stack([own[log] for own in moved], axis=-1))
                    for log, record in enumerate(at.records)
                ]
            )
            for place, group in enumerate(several):
                for k in group:
                    outputs = alone.get(k, np.arange(whole.shape[1]))
                    own = SparseColumns.at(outputs, whole[:, :, [place]])
                    found[k] = replace(own, values=own.values / changes[k].size)
        return found

    def _one_gear_feels(self, at: Evaluation, whole: Robot, gear: int) -> bool:
        """Whether it is so: people write effects of their own."""
        moved = np.array(self._moved(at, whole, inside=True)[0])
        moved[:, outputs_of(self.robot, gear)] = 0.0
        return not np.any(moved)

    def _moved(self, at: Evaluation, whole: Robot, inside: bool) -> list[FloatArray]:
        """Return per record (N, m + b) what changes move, links swinging as before.

        Args:
            at: the robot with effects.
            whole: the same with changes.
            inside: whether all act within gears: what the motion asks of these is known.
        """
        asked = at.asked if inside else [None] * len(at.records)
        each = zip(at.records, at.raw, at.swinging, asked, strict=True)
        moved = []
        for record, before, swinging, known in each:
            try:
                moved.append(raw_residual(whole, record, swinging, known) - before)
            except IMPOSSIBLE:
                moved.append(np.full_like(before, np.nan))
        return moved

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
        if drawn(own):
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


def drawn(effect: Effect) -> bool:
    """Whether an effect's numbers are drawn to what is usual before the logs speak."""
    return bool(effect.search.departures(effect).size)


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
    used, felt = np.any(changes, axis=1), np.flatnonzero(slope.any(axis=0))
    if not felt.size:
        return np.zeros((record.rows, changes.shape[1]))
    columns = np.einsum("ni,nip->np", slope[:, felt], record.regressor[:, felt][..., used])
    return record.condensed_at(np.ascontiguousarray(columns), output) @ changes[used]


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
