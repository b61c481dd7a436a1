"""Candidate causes as columns of a regression."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.effects.pseudo_inertia import LOG_CHOLESKY, departures
from wbc.errors import EffectError, RobotError, TransmissionError
from wbc.identification.model.columns import Change, Columns, SparseColumns
from wbc.identification.model.residual import Evaluation, raw_residual
from wbc.identification.records.record import Record
from wbc.robot import Effect, Evidence, Robot, Screen

_ROUNDING = 1e-4  # a unit smaller than this beside its neighbours has no effect of first order

_Offer = tuple[type[Effect], str, Screen]


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

    @property
    def drawn(self) -> bool:
        """Whether its numbers are drawn to what is usual before the logs speak."""
        return bool(self.usual.any())

    def build(self, robot: Robot, coefficients: FloatArray) -> Effect | None:
        """Return the effect with these coefficients, or None if `robot` cannot have it."""
        try:
            effect = self.effect.at(self.where, self.screen.combine(coefficients))
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
    columns: Columns,
    at: Evaluation,
    candidates: Sequence[type[Effect]],
    shown: Sequence[tuple[Evidence, Collection[str] | None]],
    failures: Counter[str] | None = None,
    still: Collection[str] = (),
) -> list[Regressor]:
    """Return every candidate at every place in every shape, with its columns.

    Links swing as they do: another effect hardly changes that.

    Args:
        columns: of the robot on its logs.
        at: the robot with effects, none of which is offered again.
        candidates: effect classes.
        shown: evidence for shapes that depend on the data, and the places where it counts, None
            for all.
        failures: errors inside effects, which then offer nothing, are counted there.
        still: joints at which no cause acts, because they rest in all logs.
    """
    taken = {effect.key for effect in at.effects}
    different: dict[tuple[object, ...], _Offer] = {}
    for known, places in shown:
        for effect in candidates:
            for offer in _offers(at.robot, effect, known, failures):
                _, where, screen = offer
                if where in still:
                    continue
                if (places is None or where in places) and (effect.name, where) not in taken:
                    units = (tuple(sorted(unit.items())) for unit in screen.units)
                    key = (effect, where, *units)
                    different.setdefault(key, offer)
    offers = list(different.values())
    try:
        found = _columns(columns, at, offers)
    except Exception:  # an effect that fails takes no other with it
        offers = [offer for offer in offers if _works(columns, at, offer, failures)]
        found = _columns(columns, at, offers)
    regressors = []
    for (effect, where, screen), own in zip(offers, found, strict=True):
        if own is None or not own.finite:
            continue
        size = own.sizes
        used = size > _ROUNDING * max(float(size.max()), np.finfo(float).tiny)
        if used.any():
            kept = _only(screen, used)
            usual = _usual(effect, kept)
            regressors.append(Regressor(effect, where, kept, own.only(used), usual))
    return regressors


def _columns(
    columns: Columns, at: Evaluation, offers: Sequence[_Offer]
) -> list[SparseColumns | None]:
    """Return what the units of every offer take from the residual, None where one is impossible."""
    changes: list[Change] = []
    units: list[slice | None] = []
    for offer in offers:
        try:
            made = [Change(offer[0].at(offer[1], values), -1.0) for values in offer[2].units]
        except EffectError:
            units.append(None)
            continue
        units.append(slice(len(changes), len(changes) + len(made)))
        changes += made
    found = columns.of(at, changes, held=True)
    result: list[SparseColumns | None] = []
    for own in units:
        parts = [] if own is None else [column for column in found[own] if column is not None]
        whole = own is not None and len(parts) == own.stop - own.start
        result.append(SparseColumns.beside(parts) if whole and parts else None)
    return result


def _usual(effect: type[Effect], screen: Screen) -> FloatArray:
    """Return (r, r) how fast units depart from what is usual; zero for most effects."""
    if not effect.search.drawn:
        return np.zeros((len(screen.units), len(screen.units)))
    numbers = [np.reshape([*unit.values()], (-1, len(LOG_CHOLESKY))) for unit in screen.units]
    steps = departures(np.array(numbers)).reshape(len(numbers), -1)
    return np.asarray(steps @ steps.T)


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


def _works(columns: Columns, at: Evaluation, offer: _Offer, failures: Counter[str] | None) -> bool:
    try:
        _columns(columns, at, [offer])
    except Exception as error:
        _count(failures, offer[0], error)
        return False
    return True


def _count(failures: Counter[str] | None, effect: type[Effect], error: Exception) -> None:
    if failures is not None:
        failures[f"{effect.name}: {type(error).__name__}: {error}"] += 1


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
