"""Candidate causes as columns of a regression."""

from __future__ import annotations

from collections import ChainMap, Counter
from collections.abc import Collection, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.dynamics import inertial_parameters
from wbc.errors import DynamicsError, EffectError, RobotError, TransmissionError
from wbc.identification.model.added_torque import (
    ADDS,
    AddedTorque,
    added_torque,
    condensed,
)
from wbc.identification.model.inertial_columns import inertial_columns, only_inertial
from wbc.identification.model.kept_columns import keeps_motion, lossy_gears
from wbc.identification.model.residual import (
    Asked,
    asked_of_gears,
    drive_slopes,
    raw_residual,
    swing_of,
)
from wbc.identification.model.sparse_columns import SparseColumns, outputs_of, own_gear
from wbc.identification.records.record import Record
from wbc.robot import Effect, Evidence, Robot, Screen

_ROUNDING = 1e-4  # a unit smaller than this beside its neighbours has no effect of first order
_BATCH = 64  # offers or columns filtered together; more only costs memory

_Offer = tuple[type[Effect], str, Screen]
_Units = tuple[tuple[tuple[str, float], ...], ...]
ShelfKey = tuple[type[Effect], str, _Units, tuple[tuple[str, str], ...]]
Shelf = MutableMapping[ShelfKey, SparseColumns]
"""Columns (rows, outputs, r) by effect, place, units and options."""


@dataclass(frozen=True, eq=False)
class Regressor:
    """One effect at one place in one of its linear shapes.

    Attributes:
        effect: the class.
        where: its place.
        screen: unit effects and how coefficients become parameters.
        columns: (rows, outputs, r) what each unit adds to the model's torque.
        usual: (r, r) normal equations of what is usual before the logs speak.
    """

    effect: type[Effect]
    where: str
    screen: Screen
    columns: SparseColumns
    usual: FloatArray

    @property
    def size(self) -> int:
        """r, the number of columns."""
        return int(self.columns.values.shape[2])

    @property
    def key(self) -> tuple[str, str]:
        """Effect name and place; a model holds each at most once."""
        return self.effect.name, self.where

    def build(self, robot: Robot, coefficients: FloatArray) -> Effect | None:
        """Return the effect with these coefficients, or None if `robot` cannot have it."""
        try:
            effect = _made(self.effect, self.where, self.screen, self.screen.combine(coefficients))
            effect.change(robot)
        except (EffectError, TransmissionError, RobotError):
            return None
        return effect


def evidence(robot: Robot, records: Sequence[Record]) -> Evidence:
    """Return motions and unexplained torque of `robot` on `records`, for data-driven screens."""
    unexplained = []
    for record in records:
        residual = raw_residual(robot, record) * record.weight
        torque = np.zeros(record.motion.velocity.shape)
        torque[:, robot.actuated] = residual[:, : robot.transmission.size]
        end = robot.transmission.size + robot.floating_size
        torque[:, robot.unactuated] = residual[:, robot.transmission.size : end]
        unexplained.append(torque)
    return Evidence(
        motions=tuple(record.motion for record in records),
        unexplained=tuple(unexplained),
        reported=tuple(record.torque for record in records),
        currents=np.all([record.currents for record in records], axis=0),
    )


def make_regressors(
    robot: Robot,
    records: Sequence[Record],
    candidates: Sequence[type[Effect]],
    known: Evidence,
    shelf: Shelf | None = None,
    failures: Counter[str] | None = None,
    places: Collection[str] | None = None,
    common: Shelf | None = None,
) -> list[Regressor]:
    """Return every candidate at every place in every shape, with its columns.

    Args:
        robot: the model whose residual is to be explained, or one close to it.
        records: the logs.
        candidates: effect classes.
        known: evidence for shapes that depend on the data.
        shelf: columns made of this robot before; new ones are put there.
        failures: errors inside effects, which then offer nothing, are counted there.
        places: that are considered, by default all.
        common: columns that do not depend on what else the robot has (`adds`), of any robot with
            perfect drives and gears, the true motion and the links of this one.
    """
    own: Shelf = {} if shelf is None else shelf
    alone = [effect for effect in candidates if common is not None and adds(robot, effect)]
    shelf = own if common is None else ChainMap(own, common)
    offers = [
        offer
        for effect in candidates
        for offer in _offers(robot, effect, known, failures)
        if places is None or offer[1] in places
    ]
    new = [o for o in offers if shelf_key(*o) not in shelf and _changed(robot, *o) is not None]
    try:
        parts = [_columns(robot, record, new) for record in records]
    except Exception:  # an effect that fails takes no other with it
        new = [o for o in new if _works(robot, records, o, failures)]
        parts = [_columns(robot, record, new) for record in records]
    for offer, *columns in zip(new, *parts, strict=True):
        target = common if common is not None and offer[0] in alone else own
        target[shelf_key(*offer)] = SparseColumns.stacked(columns)
    regressors = []
    for effect, where, screen in offers:
        stacked = shelf.get(shelf_key(effect, where, screen))
        if stacked is None or not stacked.finite:
            continue
        size = stacked.sizes
        used = size > _ROUNDING * max(float(size.max()), np.finfo(float).tiny)
        if used.any():
            kept = _only(screen, used)
            usual = _usual(robot, effect, where, kept)
            regressors.append(Regressor(effect, where, kept, stacked.only(used), usual))
    return regressors


def adds(robot: Robot, effect: type[Effect]) -> bool:
    """Whether an effect only adds torque to what a robot with perfect gears and drives needs."""
    if effect.acts_by <= ADDS:
        return True
    places = effect.places(robot)
    return bool(places) and only_inertial(robot, effect.at(places[0]))


def alone_on(robot: Robot, given: Robot) -> bool:
    """Whether what `adds` to a robot is what it adds to the robot as given."""
    sums = all(effect.acts_by <= ADDS | {"change"} for effect in robot.effects)
    return sums and not lossy_gears(robot).any() and robot.model is given.model


def _usual(robot: Robot, effect: type[Effect], where: str, screen: Screen) -> FloatArray:
    """Return (r, r) how fast units depart from what is usual; zero for most effects."""
    departures = effect.search.departures
    first = departures(_made(effect, where, screen, screen.units[0]))
    if not first.size:
        return np.zeros((len(screen.units), len(screen.units)))
    null = departures(effect.at(where, effect.null_values(robot, where)))
    slopes = [departures(_made(effect, where, screen, unit)) - null for unit in screen.units]
    return np.array([[one @ other for other in slopes] for one in slopes])


def _offers(
    robot: Robot,
    effect: type[Effect],
    known: Evidence,
    failures: Counter[str] | None,
) -> list[_Offer]:
    try:
        return [
            (effect, where, screen)
            for where in effect.places(robot)
            for screen in effect.search.screens(effect, robot, where, known)
        ]
    except Exception as error:  # whatever one effect does, the others are still offered
        _count(failures, effect, error)
        return []


def _works(
    robot: Robot, records: Sequence[Record], offer: _Offer, failures: Counter[str] | None
) -> bool:
    try:
        for record in records:
            _columns(robot, record, [offer])
    except Exception as error:
        _count(failures, offer[0], error)
        return False
    return True


def _count(failures: Counter[str] | None, effect: type[Effect], error: Exception) -> None:
    if failures is not None:
        failures[f"{effect.name}: {type(error).__name__}: {error}"] += 1


def shelf_key(effect: type[Effect], where: str, screen: Screen) -> ShelfKey:
    """Return by what the columns of an offer are kept."""
    units = tuple(tuple(sorted(unit.items())) for unit in screen.units)
    return effect, where, units, tuple(sorted(screen.options.items()))


def _made(effect: type[Effect], where: str, screen: Screen, values: Mapping[str, float]) -> Effect:
    made = effect.at(where, values)
    return replace(made, **screen.options) if screen.options else made


def _changed(robot: Robot, effect: type[Effect], where: str, screen: Screen) -> list[Robot] | None:
    """Return the robot with every unit of a screen, None if it cannot have one of them."""
    try:
        made = [_made(effect, where, screen, values) for values in screen.units]
        return [robot.with_effect(one) for one in made]
    except (EffectError, TransmissionError, RobotError):
        return None


def _columns(
    robot: Robot, record: Record, offers: Sequence[tuple[type[Effect], str, Screen]]
) -> list[SparseColumns]:
    """Return (rows, outputs, r) what the units of every offer change, filtered all at once."""
    if not offers:
        return []
    swing = swing_of(robot, record)
    swinging = None if swing is None else swing.torque
    base = raw_residual(robot, record, swinging)
    result: dict[int, SparseColumns] = {}
    if swinging is None:
        result |= _inertial_columns(robot, record, offers)
        result |= _added_columns(robot, record, offers)
    rest = {k: offer for k, offer in enumerate(offers) if k not in result}
    result |= _gear_columns(robot, record, rest, swinging, base)
    slow = [k for k in range(len(offers)) if k not in result]
    for first in range(0, len(slow), _BATCH):
        changes, sizes = [], []
        batch = slow[first : first + _BATCH]
        for offer in (offers[k] for k in batch):
            robots = _changed(robot, *offer) or []
            # Another effect hardly changes how a link swings.
            changes += [base - _residual(changed, record, swinging, base) for changed in robots]
            sizes.append(len(robots))
        columns = record.condense(np.stack(changes, axis=-1))
        parts = np.split(columns, np.cumsum(sizes)[:-1], axis=-1)
        result |= {k: SparseColumns.of(part) for k, part in zip(batch, parts, strict=True)}
    return [result[k] for k in range(len(offers))]


def _added_columns(
    robot: Robot, record: Record, offers: Sequence[tuple[type[Effect], str, Screen]]
) -> dict[int, SparseColumns]:
    """Return the columns (rows, outputs, r) of the offers that only add torque.

    The rest of the robot is not computed again for each of them.
    """
    if not keeps_motion(robot):
        return {}
    lossy, sizes = np.flatnonzero(lossy_gears(robot)), drive_slopes(robot, [record])[0]

    def added() -> Iterator[tuple[int, AddedTorque]]:
        """Yield what each unit of an offer adds, with the number of the offer."""
        for k, (effect, where, screen) in enumerate(offers):
            if not effect.acts_by <= ADDS:
                continue
            units = [_made(effect, where, screen, values) for values in screen.units]
            taken = [added_torque(robot, unit, record) for unit in units]
            felt = [t for t in taken if t is not None and not np.isin(t.outputs, lossy).any()]
            if len(felt) == len(units):
                yield from ((k, torque) for torque in felt)

    columns: dict[int, list[SparseColumns]] = {}
    waiting = added()
    while batch := list(islice(waiting, _BATCH)):
        found = condensed(record, [torque for _, torque in batch])
        for (k, _), column in zip(batch, found, strict=True):
            columns.setdefault(k, []).append(column.over(sizes))
    return {k: SparseColumns.beside(parts) for k, parts in columns.items()}


def _gear_columns(
    robot: Robot,
    record: Record,
    offers: Mapping[int, _Offer],
    swinging: FloatArray | None,
    base: FloatArray,
) -> dict[int, SparseColumns]:
    """Return the columns (rows, outputs, r) of offers that one gear alone feels, by number.

    The robot has one effect in all its gears at once: every gear shows its own. What the motion
    asks of the gears is the same for all of them.
    """
    asked = asked_of_gears(robot, record, swinging) if offers else None
    alike: dict[tuple[object, ...], dict[int, int]] = {}  # number of an offer -> its gear
    shapes: Counter[tuple[object, ...]] = Counter()
    alone: dict[type[Effect], bool] = {}  # whether it is so: people write effects of their own
    for k, (effect, where, screen) in offers.items():
        first = _made(effect, where, screen, screen.units[0])
        gear = own_gear(robot, first, [record])
        if gear is not None and effect not in alone:
            changed = base - _residual(robot.with_effect(first), record, swinging, base, asked)
            changed[:, outputs_of(robot, gear)] = 0.0
            alone[effect] = not np.any(changed)
        if gear is not None and alone[effect]:
            shapes[effect, where] += 1
            alike.setdefault((effect, len(screen.units), shapes[effect, where]), {})[k] = gear
    result: dict[int, SparseColumns] = {}
    for gears in alike.values():
        changes = []
        for unit in range(len(offers[next(iter(gears))][2].units)):
            made = [_made(*offers[k], offers[k][2].units[unit]) for k in gears]
            whole = robot.with_effects(*made)
            changes.append(base - _residual(whole, record, swinging, base, asked))
        columns = record.condense(np.stack(changes, axis=-1))
        for k, gear in gears.items():
            result[k] = SparseColumns.at(outputs_of(robot, gear), columns)
    return result


def _inertial_columns(
    robot: Robot, record: Record, offers: Sequence[tuple[type[Effect], str, Screen]]
) -> dict[int, SparseColumns]:
    """Return the columns (rows, outputs, r) of the offers that only change the links' inertias.

    All of them are sums of the columns of the links' parameters.
    """
    inertial = {}
    only: dict[type[Effect], bool] = {}
    for k, (effect, where, screen) in enumerate(offers):
        first = _made(effect, where, screen, screen.units[0])
        if only.setdefault(effect, only_inertial(robot, first)):
            inertial[k] = offers[k]
    if not inertial:
        return {}
    before = inertial_parameters(robot)
    unit = inertial_columns(robot, [record], [None], np.eye(before.size))
    result = {}
    for k, offer in inertial.items():
        robots = _changed(robot, *offer) or []
        changes = [inertial_parameters(changed) - before for changed in robots]
        # A column is what the unit takes away from the residual.
        result[k] = SparseColumns.of(-unit @ np.stack(changes, axis=-1))
    return result


def _residual(
    robot: Robot,
    record: Record,
    held: FloatArray | None,
    like: FloatArray,
    asked: Asked | None = None,
) -> FloatArray:
    """Return what a robot leaves (N, m + b), no numbers where one of its links flies off."""
    try:
        return raw_residual(robot, record, held, asked)
    except DynamicsError:
        return np.full_like(like, np.nan)


def _only(screen: Screen, used: BoolArray) -> Screen:
    """Return the screen without the units that change nothing on these logs."""
    if used.all():
        return screen

    def combine(coefficients: FloatArray) -> dict[str, float]:
        full = np.zeros(used.size)
        full[used] = coefficients
        return screen.combine(full)

    units = tuple(unit for unit, keep in zip(screen.units, used, strict=True) if keep)
    return replace(screen, units=units, combine=combine)
