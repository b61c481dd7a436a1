"""Refining the parameters of a set of effects: bounded Gauss-Newton on the full model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import DynamicsError, EffectError, TransmissionError
from wbc.identification.record import Record
from wbc.identification.residual import condensed_residual, deflects, swinging_torque
from wbc.robot import Effect, Parameter, Robot

_ITERATIONS = 12
_CONVERGED = 1e-4
_CONVERGED_ROUGH = 3e-3  # a bouncing link has no smooth error to follow further
_UNFELT = 1e-4  # share of its neighbours below which a parameter is left where it is
_KNOWS_NOTHING = 1e-2  # share of the information of all rows


@dataclass(frozen=True, eq=False)
class Fit:
    """A robot with effects whose parameters minimise the whitened residual on some records.

    Attributes:
        robot: with the effects.
        effects: as fitted, in order.
        residual: (rows, outputs), whitened.
        jacobian: (rows, outputs, p) change of the whitened residual per unit of each parameter's
            scale.
        parameters: the p fitted parameters as (number of effect, parameter).
    """

    robot: Robot
    effects: tuple[Effect, ...]
    residual: FloatArray
    jacobian: FloatArray
    parameters: tuple[tuple[int, Parameter], ...]

    @property
    def values(self) -> FloatArray:
        """Parameters (p,) in units of their scales."""
        return np.array([self.effects[k].values[p.name] / p.scale for k, p in self.parameters])

    @property
    def error(self) -> float:
        """Mean square of the whitened residual on the records of the fit."""
        return float(np.mean(self.residual**2))

    def held_out(self, folds: IntArray) -> FloatArray:
        """Return (rows, outputs) squares, each fold predicted without itself.

        The parameters of each fold are one Gauss-Newton step away from those of all records. Where
        the model is too rough for such a step (a bouncing link), the fold's parameters stay.
        """
        if any(deflects(effect) for effect in self.effects):
            return self._held_out_damped(folds)
        squares = np.empty(self.residual.shape)
        for fold in np.unique(folds):
            inside = folds == fold
            step = self.step(~inside) if self.parameters else np.zeros(0)
            moved = self.residual[inside] + self.jacobian[inside] @ step
            squares[inside] = moved**2
        return squares

    def _held_out_damped(self, folds: IntArray) -> FloatArray:
        squares = self.residual**2
        for fold in np.unique(folds):
            inside = folds == fold
            step = self.step(~inside)
            moved = self.residual + self.jacobian @ step
            if np.sum(moved[inside] ** 2) < 4.0 * np.sum(squares[inside]):
                squares[inside] = moved[inside] ** 2
        return squares

    def step(self, rows: BoolArray | IntArray) -> FloatArray:
        """Return the Gauss-Newton step (p,) on a choice of rows.

        Directions about which those rows know next to nothing compared with all rows stay put;
        else a clipping limit that only one block reached would fly away on the others.
        """
        p = len(self.parameters)
        norm = np.sqrt(np.sum(self.jacobian**2, axis=(0, 1)))
        norm = np.where(norm > 1e-7 * norm.max(initial=0.0), norm, np.inf)
        a = self.jacobian[rows].reshape(-1, p) / norm
        gram = a.T @ a + _KNOWS_NOTHING * np.eye(p)
        return np.asarray(np.linalg.solve(gram, -(a.T @ self.residual[rows].ravel())) / norm)


def refine(
    robot: Robot,
    effects: Sequence[Effect],
    records: Sequence[Record],
    whitening: FloatArray,
    iterations: int = _ITERATIONS,
) -> Fit:
    """Fit all parameters of `effects` added to `robot`.

    Args:
        robot: the robot that lacks them.
        effects: start values.
        records: the logs.
        whitening: (outputs, judged outputs) by which residuals are multiplied.
        iterations: at most this many Gauss-Newton steps.
    """
    current = list(effects)
    slots = tuple((k, p) for k, effect in enumerate(current) for p in effect.parameters)
    residual = _residual(robot, current, records, whitening)
    jacobian = _jacobian(robot, current, slots, records, whitening, residual)
    least = _CONVERGED_ROUGH if any(deflects(effect) for effect in effects) else _CONVERGED
    for _ in range(iterations if slots else 0):
        step = _bounded_step(current, slots, jacobian, residual)
        moved, change = _line_search(robot, current, slots, step, records, whitening, residual)
        if moved is None:
            break
        current, after = moved
        gain = float(np.sum(residual**2) - np.sum(after**2)) / float(np.sum(residual**2))
        residual = after
        jacobian = _jacobian(robot, current, slots, records, whitening, residual)
        if gain < least or change < _CONVERGED:
            break
    return Fit(robot.with_effects(*current), tuple(current), residual, jacobian, slots)


def _residual(
    robot: Robot, effects: Sequence[Effect], records: Sequence[Record], whitening: FloatArray
) -> FloatArray:
    return condensed_residual(robot.with_effects(*effects), records) @ whitening


def _jacobian(
    robot: Robot,
    effects: Sequence[Effect],
    slots: Sequence[tuple[int, Parameter]],
    records: Sequence[Record],
    whitening: FloatArray,
    residual: FloatArray,
) -> FloatArray:
    columns = []
    whole = robot.with_effects(*effects)
    swinging = [swinging_torque(whole, record) for record in records] if slots else []
    for k, parameter in slots:
        # What is no part of a soft gear hardly changes how its link swings.
        held = None if deflects(effects[k]) else swinging
        for size in (1e-3, -1e-3):
            step = size * parameter.scale
            try:
                changed = _moved(effects, {(k, parameter.name): step})
                moved = condensed_residual(robot.with_effects(*changed), records, held)
                column = (moved @ whitening - residual) / size
            except (EffectError, TransmissionError, DynamicsError):
                continue
            columns.append(column)
            break
        else:
            columns.append(np.zeros_like(residual))
    if not columns:
        return np.zeros((*residual.shape, 0))
    jacobian = np.stack(columns, axis=-1)
    size = np.sqrt(np.mean(jacobian**2, axis=(0, 1)))
    for row, (k, _) in enumerate(slots):
        beside = max(size[other] for other, (owner, _) in enumerate(slots) if owner == k)
        if size[row] < _UNFELT * beside:
            jacobian[:, :, row] = 0.0
    return jacobian


def _moved(
    effects: Sequence[Effect], changes: dict[tuple[int, str], float], *, clip: bool = False
) -> list[Effect]:
    result = list(effects)
    for (k, name), change in changes.items():
        effect = result[k]
        value = effect.values[name] + change
        if clip:
            bound = next(p for p in effect.parameters if p.name == name)
            value = float(np.clip(value, bound.low, bound.high))
        result[k] = effect.with_values({name: value})
    return result


def _bounded_step(
    effects: Sequence[Effect],
    slots: Sequence[tuple[int, Parameter]],
    jacobian: FloatArray,
    residual: FloatArray,
) -> FloatArray:
    """Return the Gauss-Newton step with parameters at a bound held when pushed against it."""
    a, r = jacobian.reshape(-1, len(slots)), residual.ravel()
    values = np.array([effects[k].values[p.name] for k, p in slots])
    low = np.array([p.low for _, p in slots])
    high = np.array([p.high for _, p in slots])
    free = np.ones(len(slots), dtype=bool)
    step = np.zeros(len(slots))
    for _ in range(len(slots) + 1):
        step = np.zeros(len(slots))
        if free.any():
            step[free] = _least_squares(a[:, free], -r)
        blocked = free & (((values <= low) & (step < 0.0)) | ((values >= high) & (step > 0.0)))
        if not blocked.any():
            break
        free &= ~blocked
    return step


def _line_search(
    robot: Robot,
    effects: Sequence[Effect],
    slots: Sequence[tuple[int, Parameter]],
    step: FloatArray,
    records: Sequence[Record],
    whitening: FloatArray,
    residual: FloatArray,
) -> tuple[tuple[list[Effect], FloatArray] | None, float]:
    before = float(np.sum(residual**2))
    length = 1.0
    for _ in range(5):
        changes = {
            (k, p.name): length * float(s) * p.scale for (k, p), s in zip(slots, step, strict=True)
        }
        try:
            moved = _moved(effects, changes, clip=True)
            after = _residual(robot, moved, records, whitening)
        except (EffectError, TransmissionError, DynamicsError):
            length *= 0.4
            continue
        if float(np.sum(after**2)) < before:
            return (moved, after), float(np.max(np.abs(length * step), initial=0.0))
        length *= 0.4
    return None, 0.0


def _least_squares(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the least-squares solution with columns scaled and weak directions left alone."""
    norm = np.sqrt(np.sum(a**2, axis=0))
    felt = norm > 1e-7 * norm.max(initial=0.0)
    solution = np.zeros(norm.size)
    scaled = a[:, felt] / norm[felt]
    solution[felt] = np.linalg.lstsq(scaled, b, rcond=1e-8)[0] / norm[felt]
    return solution
