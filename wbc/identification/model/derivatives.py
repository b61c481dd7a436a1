"""The whitened residual of a robot with effects, and its derivatives by their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import DynamicsError
from wbc.identification.model.inertial_columns import (
    inertial_columns,
    only_inertial,
    parameter_changes,
)
from wbc.identification.model.kept_columns import (
    IMPOSSIBLE,
    STEP,
    KeptColumns,
    Slots,
    keeps_motion,
    lossy_gears,
)
from wbc.identification.model.link_friction import rubbing_at_link
from wbc.identification.model.link_motion import LinkSwing
from wbc.identification.model.residual import (
    Asked,
    asked_of_gears,
    condensed_residual,
    drive_slopes,
    swing_of,
)
from wbc.identification.model.sparse_columns import SparseColumns, outputs_of, own_gear
from wbc.identification.model.yielding import deflects, loose
from wbc.identification.records.record import Record
from wbc.robot import Effect, Motion, Parameter, Robot

# Share of its value by which a number is varied where links bounce: what they leave is smooth only
# from afar. A play 10 % too large stays where it is with 0.07 %; with 1 % a play 10 % too small is
# found to 1.4 %.
_ROUGH_STEP = 0.01
_UNFELT = 1e-4  # share of its neighbours below which a parameter is left where it is


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What effects with these parameters leave.

    Attributes:
        effects: added to the robot.
        robot: with the effects.
        condensed: (rows, m + b) what is left [N m, N].
        residual: (rows, outputs), whitened.
        swings: per record, how links swing behind their gears, or None.
        sizes: (rows, m + b) by what the drives divide the residual.
        asked: per record, what the motion asks of the gears, or None.
    """

    effects: tuple[Effect, ...]
    robot: Robot
    condensed: FloatArray
    residual: FloatArray
    swings: tuple[LinkSwing | None, ...]
    sizes: FloatArray
    asked: tuple[Asked | None, ...]

    @property
    def swinging(self) -> tuple[FloatArray | None, ...]:
        """Per record (N, nv), what links that swing behind their gears need more, or None."""
        return _torques(self.swings)

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(np.sum(self.residual**2))


def evaluate(
    robot: Robot,
    effects: Sequence[Effect],
    records: Sequence[Record],
    whitening: FloatArray,
    near: Evaluation | None = None,
) -> Evaluation:
    """Return what `robot` with `effects` leaves; links that swing are simulated once.

    Args:
        robot: that lacks the effects.
        effects: to add.
        records: the logs.
        whitening: (outputs, judged outputs) by which residuals are multiplied.
        near: the same effects with numbers close by.

    Raises:
        DynamicsError: a link flies off behind its gear, or an effect gives what is not finite.
    """
    whole = robot.with_effects(*effects)
    swings = _swings_of(whole, records, near)
    swinging = _torques(swings)
    pairs = zip(records, swinging, strict=True)
    asked = tuple(asked_of_gears(whole, record, held) for record, held in pairs)
    condensed = condensed_residual(whole, records, swinging, asked)
    if not np.isfinite(condensed).all():
        names = ", ".join(f"{effect.name} at '{effect.where}'" for effect in effects)
        raise DynamicsError(f"'{robot.name}' with {names} needs torque that is not finite.")
    sizes = drive_slopes(whole, records)
    whitened = condensed @ whitening
    return Evaluation(tuple(effects), whole, condensed, whitened, swings, sizes, asked)


def _swings_of(
    robot: Robot, records: Sequence[Record], near: Evaluation | None, *, straight: bool = False
) -> tuple[LinkSwing | None, ...]:
    known = [None] * len(records) if near is None else near.swings
    bents = [None if swing is None else swing.bent for swing in known]
    pairs = zip(records, bents, strict=True)
    return tuple(swing_of(robot, record, bent, straight=straight) for record, bent in pairs)


def _torques(swings: Sequence[LinkSwing | None]) -> tuple[FloatArray | None, ...]:
    return tuple(None if swing is None else swing.torque for swing in swings)


def derivatives(
    robot: Robot,
    at: Evaluation,
    slots: Slots,
    records: Sequence[Record],
    whitening: FloatArray,
    known: FloatArray | None = None,
    kept: KeptColumns | None = None,
) -> FloatArray:
    """Return the change (rows, outputs, p) of the residual per scale of each parameter.

    Args:
        robot: that lacks the effects.
        at: where.
        slots: the p parameters as (number of effect, parameter).
        records: the logs.
        whitening: (outputs, judged outputs) by which residuals are multiplied.
        known: (rows, outputs, p) derivatives nearby. Those by parameters that change how links
            swing are taken from it, so that nothing is simulated.
        kept: columns of this robot on these logs; new ones are put there.
    """
    if not slots:
        return np.zeros((*at.residual.shape, 0))
    # One column after the other: each is written, and read again, as a whole.
    columns = np.zeros((len(slots), *at.residual.shape))
    inertial = _inertial(robot, at, slots, records)  # by number of the column
    felt: dict[int, IntArray] = {}  # outputs that alone feel a parameter, by number of the column
    single = []  # numbers of the other columns
    lossy = np.flatnonzero(lossy_gears(at.robot))
    taken = [] if known is None else _taken(robot, at, slots, records[0].motion)
    rest = [row for row in range(len(slots)) if row not in inertial and row not in taken]
    apart = _apart(at, slots, rest, kept)
    for row, (k, _) in enumerate(slots):
        if row in inertial:
            columns[row] = inertial[row] @ whitening
            continue
        if known is not None and row in taken:
            columns[row] = known[:, :, row]
            continue
        column = apart.get(row)
        if column is not None and not np.isin(column.outputs, lossy).any():
            columns[row] = _whitened(column, at.sizes, whitening)
            continue
        outputs = _felt(robot, at, k, column, records)
        if outputs is None:
            single.append(row)
        else:
            felt[row] = outputs
    for group in _disjoint(felt):
        found = _together(robot, at, [slots[row] for row in group], records)
        if found is None:
            single += group
            continue
        for row in group:
            columns[row] = found[:, felt[row]] @ whitening[felt[row]]
    swinging = set(_taken(robot, at, slots, records[0].motion)) & set(single)
    if swinging:
        held = _torques(_swings_of(at.robot, records, at, straight=True))
        stays = condensed_residual(at.robot, records, held)
    for row in single:
        beside = (stays, True) if row in swinging else (at.condensed, False)
        columns[row] = _derivative(robot, at, *slots[row], records, *beside) @ whitening
    size = np.array([np.linalg.norm(column) for column in columns])
    for row, (k, _) in enumerate(slots):
        beside = max(size[other] for other, (owner, _) in enumerate(slots) if owner == k)
        if size[row] < _UNFELT * beside:
            columns[row] = 0.0
    return np.moveaxis(columns, 0, -1)


def _whitened(column: SparseColumns, sizes: FloatArray, whitening: FloatArray) -> FloatArray:
    """Return a single column (rows, outputs) that the drives divide by `sizes` (rows, m + b)."""
    outputs = column.outputs
    return np.asarray((column.values[:, :, 0] / sizes[:, outputs]) @ whitening[outputs])


def _inertial(
    robot: Robot, at: Evaluation, slots: Slots, records: Sequence[Record]
) -> dict[int, FloatArray]:
    """Return the columns (rows, m + b) by parameters that only change the links' inertias."""
    if any(deflects(effect) for effect in at.effects):
        return {}  # how links swing depends on their inertias
    kinds = {type(effect): effect for effect in at.effects}
    inertial = {kind for kind, effect in kinds.items() if only_inertial(robot, effect)}
    own = {k for k, effect in enumerate(at.effects) if type(effect) in inertial}
    varied = [(row, k, parameter) for row, (k, parameter) in enumerate(slots) if k in own]
    found = parameter_changes(robot, at.effects, varied)
    if not found:
        return {}
    changes = np.stack(list(found.values()), axis=-1)
    columns = inertial_columns(at.robot, records, at.swinging, changes)
    return {row: columns[:, :, place] for place, row in enumerate(found)}


def _taken(robot: Robot, at: Evaluation, slots: Slots, motion: Motion) -> list[int]:
    """Return the columns of parameters that change how links swing."""
    swinging = {k for k in range(len(at.effects)) if _swings(robot, at, k, motion)}
    return [row for row, (k, _) in enumerate(slots) if k in swinging]


def _apart(
    at: Evaluation, slots: Slots, rows: Sequence[int], kept: KeptColumns | None
) -> dict[int, SparseColumns]:
    """Return single columns beside perfect gears and drives, by number; not all have one."""
    if kept is None or not keeps_motion(at.robot):
        return {}
    return kept.columns(at.effects, slots, rows)


def _felt(
    robot: Robot, at: Evaluation, k: int, column: SparseColumns | None, records: Sequence[Record]
) -> IntArray | None:
    """Return the outputs that alone feel effect `k`, None where all may.

    Args:
        robot: that lacks the effects.
        at: where.
        k: number of the effect.
        column: what one of its parameters changes beside perfect gears and drives, if known.
        records: the logs.
    """
    if any(deflects(effect) for effect in at.effects):
        return None
    if column is not None:
        return column.outputs
    gear = own_gear(robot, at.effects[k], records)
    return None if gear is None else outputs_of(robot, gear)


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


def _together(
    robot: Robot, at: Evaluation, slots: Slots, records: Sequence[Record]
) -> FloatArray | None:
    """Return what moving parameters together changes (rows, m + b), per scale of each.

    Args:
        robot: that lacks the effects.
        at: where.
        slots: parameters of which no two are felt by one output.
        records: the logs.

    Returns:
        None where no step of this size can be made with all of them.
    """
    in_gears = all(own_gear(robot, at.effects[k], records) is not None for k, _ in slots)
    asked = at.asked if in_gears else None  # of the gears: the same for all that acts within them
    for size in (STEP, -STEP):
        changes = {(k, parameter.name): size * parameter.scale for k, parameter in slots}
        try:
            changed = with_changes(at.effects, changes)
            whole = robot.with_effects(*changed)
            moved = condensed_residual(whole, records, at.swinging, asked)
        except IMPOSSIBLE:
            continue
        if np.isfinite(moved).all():
            return np.asarray((moved - at.condensed) / size)
    return None


def _derivative(
    robot: Robot,
    at: Evaluation,
    k: int,
    parameter: Parameter,
    records: Sequence[Record],
    stays: FloatArray,
    swings: bool,
) -> FloatArray:
    """Return the change (rows, m + b) of the residual per scale of a parameter of effect `k`.

    Args:
        robot: that lacks the effects.
        at: where.
        k: number of the effect.
        parameter: of it.
        records: the logs.
        stays: (rows, m + b) the residual with the parameter as it is.
        swings: whether the parameter changes how links swing: one round from there.
    """
    width = STEP
    if swings and loose(at.effects):
        value = abs(at.effects[k].values[parameter.name]) / parameter.scale
        width = max(STEP, _ROUGH_STEP * value)
    for size in (width, -width):
        try:
            changed = with_changes(at.effects, {(k, parameter.name): size * parameter.scale})
            whole = _whole(robot, at, k, changed)
            near = _torques(_swings_of(whole, records, at, straight=True)) if swings else None
            moved = condensed_residual(whole, records, near or at.swinging)
        except IMPOSSIBLE:
            continue
        if np.isfinite(moved).all():
            return np.asarray((moved - stays) / size)
    return np.zeros_like(at.condensed)


def _whole(robot: Robot, at: Evaluation, k: int, changed: Sequence[Effect]) -> Robot:
    """Return the robot with effects of which number `k` is not as in `at`."""
    if "change" in at.effects[k].acts_by:
        return robot.with_effects(*changed)
    # Every number that effects change is as it was.
    return at.robot.with_acting((*robot.effects, *changed))


def _swings(robot: Robot, at: Evaluation, k: int, motion: Motion) -> bool:
    """Whether the parameters of an effect change how links swing behind their gears.

    What is no part of a soft gear nor of a link, nor rubs there, hardly does.
    """
    own = at.effects[k]
    if deflects(own):
        return True
    behind_gears = [effect.where for effect in at.effects if deflects(effect)]
    if own.where in behind_gears and own in rubbing_at_link(at.robot, own.where, motion):
        return True
    return bool(behind_gears) and own.change(robot).model is not robot.model


def with_changes(
    effects: Sequence[Effect], changes: Mapping[tuple[int, str], float], *, clip: bool = False
) -> list[Effect]:
    """Return the effects with changed parameters.

    Args:
        effects: as they are.
        changes: (number of effect, name of parameter) -> what is added to its value.
        clip: stop at the parameter's bounds.

    Raises:
        EffectError: a value that the effect cannot have.
    """
    result = list(effects)
    for k in dict.fromkeys(k for k, _ in changes):
        bounds = {p.name: p for p in result[k].parameters}
        values = result[k].values
        for (owner, name), change in changes.items():
            if owner != k:
                continue
            value = values[name] + change
            if clip:
                value = float(np.clip(value, bounds[name].low, bounds[name].high))
            values[name] = value
        result[k] = result[k].with_values(values)
    return result
