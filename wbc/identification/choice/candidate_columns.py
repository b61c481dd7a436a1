"""Candidate causes as columns of a regression."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import EffectError, RobotError, TransmissionError
from wbc.identification.model.residual import (
    link_response,
    raw_residual,
    rubbing_responses,
    swinging_torque,
)
from wbc.identification.model.yielding import deflects
from wbc.identification.records.record import Record
from wbc.robot import Effect, Evidence, Robot, Screen

_ROUNDING = 1e-4  # a unit smaller than this beside its neighbours has no effect of first order
_BATCH = 64  # offers filtered together; more only costs memory

_Units = tuple[tuple[tuple[str, float], ...], ...]
ShelfKey = tuple[type[Effect], str, _Units, tuple[tuple[str, str], ...]]
Shelf = dict[ShelfKey, FloatArray]
"""Columns (rows, outputs, r) by effect, place, units and options."""


@dataclass(frozen=True, eq=False)
class Atom:
    """One effect at one place in one of its linear shapes.

    Attributes:
        effect: the class.
        where: its place.
        screen: unit effects and how coefficients become parameters.
        columns: (rows, outputs, r) what each unit adds to the model's torque.
    """

    effect: type[Effect]
    where: str
    screen: Screen
    columns: FloatArray

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
        torque[:, robot.unactuated] = residual[:, robot.transmission.size :]
        unexplained.append(torque)
    return Evidence(
        motions=tuple(record.motion for record in records),
        unexplained=tuple(unexplained),
        reported=tuple(record.torque for record in records),
        responses=lambda joint: tuple(link_response(robot, record, joint) for record in records),
        rubbing=lambda joint: rubbing_responses(robot, records, joint),
    )


def make_atoms(
    robot: Robot,
    records: Sequence[Record],
    candidates: Sequence[type[Effect]],
    known: Evidence,
    shelf: Shelf | None = None,
) -> list[Atom]:
    """Return every candidate at every place in every shape, with its columns.

    Args:
        robot: the model whose residual is to be explained, or one close to it.
        records: the logs.
        candidates: effect classes.
        known: evidence for shapes that depend on the data.
        shelf: columns made of this robot before; new ones are put there.
    """
    shelf = {} if shelf is None else shelf
    offers = [
        (effect, where, screen)
        for effect in candidates
        for where in effect.places(robot)
        for screen in effect.screening(robot, where, known)
    ]
    new = [o for o in offers if _key(*o) not in shelf and _changed(robot, *o) is not None]
    parts = [_columns(robot, record, new) for record in records]
    for offer, *columns in zip(new, *parts, strict=True):
        shelf[_key(*offer)] = np.concatenate(columns)
    atoms = []
    for effect, where, screen in offers:
        stacked = shelf.get(_key(effect, where, screen))
        if stacked is None:
            continue
        size = np.sqrt(np.mean(stacked**2, axis=(0, 1)))
        used = size > _ROUNDING * max(float(size.max()), np.finfo(float).tiny)
        if used.any():
            atoms.append(Atom(effect, where, _only(screen, used), stacked[:, :, used]))
    return atoms


def _key(effect: type[Effect], where: str, screen: Screen) -> ShelfKey:
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
) -> list[FloatArray]:
    """Return (rows, outputs, r) what the units of every offer change, filtered all at once."""
    swinging = swinging_torque(robot, record)
    base = raw_residual(robot, record, swinging)
    result: list[FloatArray] = []
    for first in range(0, len(offers), _BATCH):
        changes, sizes = [], []
        for offer in offers[first : first + _BATCH]:
            robots = _changed(robot, *offer) or []
            # Another effect hardly changes how a link swings; one more soft gear does.
            held = None if deflects(offer[0]) else swinging
            changes += [base - raw_residual(changed, record, held) for changed in robots]
            sizes.append(len(robots))
        columns = record.condense(np.stack(changes, axis=-1))
        result += np.split(columns, np.cumsum(sizes)[:-1], axis=-1)
    return result


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
