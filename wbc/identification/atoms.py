"""Candidate causes as columns of a regression."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError, EffectError, RobotError, TransmissionError
from wbc.identification.record import Record
from wbc.identification.residual import condensed_residual, raw_residual
from wbc.robot import Effect, Evidence, Robot, Screen


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
            effect = self.effect.at(self.where, self.screen.combine(coefficients))
            robot.with_effect(effect)
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
    return Evidence(tuple(record.motion for record in records), tuple(unexplained))


def make_atoms(
    robot: Robot,
    records: Sequence[Record],
    candidates: Sequence[type[Effect]],
    base: FloatArray,
    known: Evidence,
) -> list[Atom]:
    """Return every candidate at every place in every shape, with its columns.

    Args:
        robot: the model whose residual is to be explained.
        records: the logs.
        candidates: effect classes.
        base: (rows, outputs) condensed residual of `robot`.
        known: evidence for shapes that depend on the data.
    """
    atoms = []
    for effect in candidates:
        for where in effect.places(robot):
            for screen in effect.screening(robot, where, known):
                columns = _columns(robot, records, effect, where, screen, base)
                if columns is not None and np.all(np.any(columns != 0.0, axis=(0, 1))):
                    atoms.append(Atom(effect, where, screen, columns))
    return atoms


def _columns(
    robot: Robot,
    records: Sequence[Record],
    effect: type[Effect],
    where: str,
    screen: Screen,
    base: FloatArray,
) -> FloatArray | None:
    columns = []
    for values in screen.units:
        try:
            changed = robot.with_effect(effect.at(where, values))
            columns.append(base - condensed_residual(changed, records))
        except (EffectError, TransmissionError, DynamicsError):
            return None
    return np.stack(columns, axis=-1)
