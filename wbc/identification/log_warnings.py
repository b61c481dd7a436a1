"""What the logs cannot tell, and what must not be believed of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.fit import Fit
from wbc.identification.folds import ROWS_PER_SAMPLE
from wbc.identification.record import Record
from wbc.measurement import Log, find_duplicates

_MOVES = 4.0  # times the noise of the smoothed speed
_STRAY = 8.0  # standard deviations between the logs' own values
_STRAY_SHARE = 0.05  # of the value itself, less is no disagreement worth a word


def without_copies(logs: Sequence[Log]) -> tuple[list[Log], list[str]]:
    """Return the logs without copies of one another, and a warning for each copy.

    A copy is no second observation: it would be held out against itself.
    """
    warnings, dropped = [], set()
    for first, *copies in find_duplicates(logs):
        for copy in copies:
            dropped.add(copy)
            warnings.append(
                f"{logs[copy].source.label} holds the same data as {logs[first].source.label} and "
                "is left out; record the motion again for a repeat."
            )
    return [log for k, log in enumerate(logs) if k not in dropped], warnings


def still_joints(records: Sequence[Record]) -> tuple[str, ...]:
    """Return the driven joints that move in no log by more than their sensors' noise."""
    robot = records[0].robot
    moving = np.zeros(robot.transmission.size, dtype=bool)
    for record in records:
        speed = np.sqrt(np.mean(record.motion.velocity[:, robot.actuated] ** 2, axis=0))
        noise = record.noise.speed_deviation(record.bandwidth.kinematics)[robot.actuated]
        moving |= speed > _MOVES * noise
    return tuple(n for n, yes in zip(robot.transmission.joints, moving, strict=True) if not yes)


def disagreements(records: Sequence[Record], fit: Fit) -> list[list[str]]:
    """Return for every effect a sentence per parameter on whose value the logs disagree.

    Logs of different robots, loads or units show so: each has a value of its own, one Gauss-Newton
    step away from the common one, and is explained by it far better than by the common one.

    Args:
        records: the logs.
        fit: to all of them.
    """
    found: list[list[str]] = [[] for _ in fit.effects]
    if len(records) < 2 or not fit.parameters:
        return found
    owner = np.repeat(np.arange(len(records)), [record.rows for record in records])
    alone = [_alone(fit, owner == k) for k in range(len(records))]
    steps, deviations = (np.array(part) for part in zip(*alone, strict=True))
    for row, (k, parameter) in enumerate(fit.parameters):
        value = fit.effects[k].values[parameter.name]
        own = value + steps[:, row] * parameter.scale
        doubt = _STRAY * float(deviations[:, row].max()) * parameter.scale
        if parameter.shape or np.ptp(own) < max(doubt, _STRAY_SHARE * abs(value)):
            continue
        low, high = int(np.argmin(own)), int(np.argmax(own))
        text = (
            f"the logs disagree on {parameter.name}: {records[low].name} alone says "
            f"{own[low]:.3g}, {records[high].name} {own[high]:.3g}"
        )
        found[k].append(text if parameter.unit == "1" else f"{text} {parameter.unit}")
    return found


def _alone(fit: Fit, rows: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the step (p,) to what some rows alone say, and its standard deviation (p,)."""
    step = fit.step(rows)
    left = fit.residual[rows] + fit.jacobian[rows] @ step
    a = fit.jacobian[rows].reshape(-1, len(fit.parameters))
    norm = np.maximum(np.sqrt(np.sum(a**2, axis=0)), 1e-300)
    gram = (a / norm).T @ (a / norm) + 1e-9 * np.eye(norm.size)
    spread = np.sqrt(ROWS_PER_SAMPLE * np.mean(left**2) * np.diag(np.linalg.inv(gram)))
    return step, np.asarray(spread / norm)
