"""Causes that a turned force sensor would imitate on these logs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.folds import ROWS_PER_SAMPLE
from wbc.identification.records.record import Record

_SAME = 0.995  # cosine from which on two signatures are one
_UNSEEN = 9.0  # chi-square of what is left of a signature that noise hides
_FAULT = 0.01  # [rad] by which sensors are tried
_PLAUSIBLE = 0.1  # [rad] beyond which a sensor would have been noticed


def force_sensor_doubts(problem: EstimationProblem, fit: Fit) -> list[list[str]]:
    """Return for every effect a sentence per contact whose force sensor could be wrong instead.

    A sensor that is turned adds a torque that follows the force. On a robot that stands, that may
    be what a wrong mass adds, and no fit can tell.

    Args:
        problem: the logs.
        fit: of the effects found.
    """
    doubts: list[list[str]] = [[] for _ in fit.effects]
    contacts = sorted({name for record in problem.records for name in record.forces})
    if not contacts:
        return doubts
    faults = {
        (name, text): _column(problem, fit, name, change)
        for name in contacts
        for text, change in _CHANGES.items()
    }
    for k in range(len(fit.effects)):
        own = [row for row, (owner, _) in enumerate(fit.parameters) if owner == k]
        other = [row for row in range(len(fit.parameters)) if row not in own]
        others = fit.jacobian[..., other].reshape(fit.residual.size, len(other))
        null = fit.effects[k].null_values(problem.robot, fit.effects[k].where)
        away = [
            (fit.effects[k].values[p.name] - null[p.name]) / p.scale
            for owner, p in fit.parameters
            if owner == k
        ]
        effect = fit.jacobian[..., own].reshape(fit.residual.size, len(own)) @ np.array(away)
        signature, *unlike = _beside(others, np.stack([effect, *faults.values()], axis=1)).T
        for (name, text), column in zip(faults, unlike, strict=True):
            size = _imitates(signature, column)
            if size is not None:
                doubts[k].append(text.format(name=name, size=abs(size)))
    return doubts


def _turned(axis: int) -> Callable[[FloatArray], FloatArray]:
    return lambda force: np.cross(np.eye(3)[axis], force)


_CHANGES: dict[str, Callable[[FloatArray], FloatArray]] = {
    f"or the force sensor of '{{name}}' is turned by {{size:.3f}} rad about {axis}: here it would "
    "look the same": _turned(k)
    for k, axis in enumerate("xyz")
}


def _column(
    problem: EstimationProblem, fit: Fit, name: str, change: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return (rows outputs,) what a sensor that is turned adds per radian."""
    wrong = [_with_force(record, name, change) for record in problem.records]
    moved = condensed_residual(fit.robot, wrong) @ problem.whitening - fit.residual
    return np.asarray(moved.ravel() / _FAULT)


def _with_force(record: Record, name: str, change: Callable[[FloatArray], FloatArray]) -> Record:
    force = record.forces[name]
    forces = {**record.forces, name: force + _FAULT * change(force)}
    return replace(record.believing(record.robot), forces=forces)


def _beside(others: FloatArray, columns: FloatArray) -> FloatArray:
    """Return what of each column (rows outputs, n) the other causes cannot take up."""
    if not others.shape[1]:
        return columns
    return np.asarray(columns - others @ np.linalg.lstsq(others, columns, rcond=1e-9)[0])


def _imitates(signature: FloatArray, fault: FloatArray) -> float | None:
    """Return how large a fault looks like the signature, None if none does."""
    power = float(fault @ fault)
    if power <= 0.0:
        return None
    size = float(signature @ fault) / power
    left = signature - size * fault
    unseen = float(left @ left) / ROWS_PER_SAMPLE < _UNSEEN
    same = float(left @ left) < (1.0 - _SAME**2) * float(signature @ signature)
    # The signature is what the effect adds to the residual: the fault takes it away.
    return -size if (unseen or same) and abs(size) < _PLAUSIBLE else None
