"""The whitened residual of a robot with effects, and its derivatives by their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError, EffectError, TransmissionError
from wbc.identification.record import Record
from wbc.identification.residual import condensed_residual, swinging_torque
from wbc.identification.swinging import deflects
from wbc.robot import Effect, Parameter, Robot

IMPOSSIBLE = (EffectError, TransmissionError, DynamicsError)
"""Raised where a robot cannot have an effect with these parameters."""

_STEP = 1e-3  # of a parameter's scale, by which it is varied
_UNFELT = 1e-4  # share of its neighbours below which a parameter is left where it is

Slots = Sequence[tuple[int, Parameter]]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What effects with these parameters leave.

    Attributes:
        effects: added to the robot.
        residual: (rows, outputs), whitened.
        swinging: per record (N, nv), what links that swing behind their gears need more, or None.
    """

    effects: tuple[Effect, ...]
    residual: FloatArray
    swinging: tuple[FloatArray | None, ...]

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(np.sum(self.residual**2))


def evaluate(
    robot: Robot, effects: Sequence[Effect], records: Sequence[Record], whitening: FloatArray
) -> Evaluation:
    """Return what `robot` with `effects` leaves; links that swing are simulated once."""
    whole = robot.with_effects(*effects)
    swinging = tuple(swinging_torque(whole, record) for record in records)
    residual = condensed_residual(whole, records, swinging) @ whitening
    return Evaluation(tuple(effects), residual, swinging)


def derivatives(
    robot: Robot,
    at: Evaluation,
    slots: Slots,
    records: Sequence[Record],
    whitening: FloatArray,
    known: FloatArray | None = None,
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
    """
    columns = []
    for row, (k, parameter) in enumerate(slots):
        if known is not None and _swings(robot, at, k):
            columns.append(known[:, :, row])
        else:
            columns.append(_derivative(robot, at, k, parameter, records, whitening))
    if not columns:
        return np.zeros((*at.residual.shape, 0))
    jacobian = np.stack(columns, axis=-1)
    size = np.sqrt(np.mean(jacobian**2, axis=(0, 1)))
    for row, (k, _) in enumerate(slots):
        beside = max(size[other] for other, (owner, _) in enumerate(slots) if owner == k)
        if size[row] < _UNFELT * beside:
            jacobian[:, :, row] = 0.0
    return jacobian


def _derivative(
    robot: Robot,
    at: Evaluation,
    k: int,
    parameter: Parameter,
    records: Sequence[Record],
    whitening: FloatArray,
) -> FloatArray:
    # What is neither part of a soft gear nor of a link hardly changes how links swing.
    held = None if _swings(robot, at, k) else at.swinging
    for size in (_STEP, -_STEP):
        try:
            changed = with_changes(at.effects, {(k, parameter.name): size * parameter.scale})
            moved = condensed_residual(robot.with_effects(*changed), records, held)
        except IMPOSSIBLE:
            continue
        return np.asarray((moved @ whitening - at.residual) / size)
    return np.zeros_like(at.residual)


def _swings(robot: Robot, at: Evaluation, k: int) -> bool:
    """Whether the parameters of an effect change how links swing behind their gears."""
    if deflects(at.effects[k]):
        return True
    behind_gears = any(deflects(effect) for effect in at.effects)
    return behind_gears and at.effects[k].change(robot).model is not robot.model


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
    for (k, name), change in changes.items():
        effect = result[k]
        value = effect.values[name] + change
        if clip:
            bound = next(p for p in effect.parameters if p.name == name)
            value = float(np.clip(value, bound.low, bound.high))
        result[k] = effect.with_values({name: value})
    return result
