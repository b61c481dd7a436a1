"""What a robot with effects leaves unexplained of its logs, whitened; links that swing with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError, EffectError, TransmissionError
from wbc.identification.model.residual import (
    Asked,
    asked_of_gears,
    drive_slopes,
    raw_residual,
    swing_of,
)
from wbc.identification.model.yielding import LinkSwing
from wbc.identification.records.record import Record
from wbc.robot import Effect, Parameter, Robot

IMPOSSIBLE = (EffectError, TransmissionError, DynamicsError)
"""Raised where a robot cannot have an effect with these parameters."""

Slots = Sequence[tuple[int, Parameter]]
"""Parameters as (number of effect, parameter)."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What effects with these parameters leave.

    Attributes:
        effects: added to the robot.
        robot: with the effects.
        records: the logs.
        raw: per record, what is left (N, m + b) before weights and filters [N m, N].
        residual: (rows, outputs), whitened.
        swings: per record, how links swing behind their gears, or None.
        asked: per record, what the motion asks of the gears, or None.
    """

    effects: tuple[Effect, ...]
    robot: Robot
    records: tuple[Record, ...]
    raw: tuple[FloatArray, ...]
    residual: FloatArray
    swings: tuple[LinkSwing | None, ...]
    asked: tuple[Asked | None, ...]

    @property
    def swinging(self) -> tuple[FloatArray | None, ...]:
        """Per record (N, nv), what links that swing behind their gears need more, or None."""
        return torques_of(self.swings)

    @cached_property
    def sizes(self) -> FloatArray:
        """(rows, m + b) by what the drives divide the residual."""
        return drive_slopes(self.robot, self.records)

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
    swings = swings_of(whole, records, near)
    swinging = torques_of(swings)
    pairs = list(zip(records, swinging, strict=True))
    asked = tuple(asked_of_gears(whole, record, held) for record, held in pairs)
    known = zip(pairs, asked, strict=True)
    raw = tuple(raw_residual(whole, record, held, of) for (record, held), of in known)
    condensed = [record.condense(left) for record, left in zip(records, raw, strict=True)]
    residual = np.concatenate(condensed)
    if not np.isfinite(residual).all():
        names = ", ".join(f"{effect.name} at '{effect.where}'" for effect in effects)
        raise DynamicsError(f"'{robot.name}' with {names} needs torque that is not finite.")
    return Evaluation(
        tuple(effects), whole, tuple(records), raw, residual @ whitening, swings, asked
    )


def swings_of(
    robot: Robot, records: Sequence[Record], near: Evaluation | None, *, straight: bool = False
) -> tuple[LinkSwing | None, ...]:
    """Return per record how links swing behind their gears, or None; see `swing_of`."""
    known = [None] * len(records) if near is None else near.swings
    bents = [None if swing is None else swing.bent for swing in known]
    pairs = zip(records, bents, strict=True)
    return tuple(swing_of(robot, record, bent, straight=straight) for record, bent in pairs)


def torques_of(swings: Sequence[LinkSwing | None]) -> tuple[FloatArray | None, ...]:
    """Return per record (N, nv) what links that swing need more, or None."""
    return tuple(None if swing is None else swing.torque for swing in swings)


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
