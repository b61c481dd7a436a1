"""What the logs cannot tell, and what must not be believed of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.fit import Fit
from wbc.identification.record import Record
from wbc.measurement import Log, find_duplicates

_MOVES = 4.0  # times the noise of the smoothed speed
_STRAY = 4.0  # times what an interval allows, between the logs' own values
_STRAY_SHARE = 0.1  # of the value itself, less is no disagreement worth a word


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


def disagreements(records: Sequence[Record], fit: Fit, bounds: FloatArray) -> list[list[str]]:
    """Return for every effect a sentence per parameter on whose value the logs disagree.

    Logs of different robots, loads or units show so: each has a value of its own, one Gauss-Newton
    step away from the common one.

    Args:
        records: the logs.
        fit: to all of them.
        bounds: (p, 2) intervals of its parameters.
    """
    found: list[list[str]] = [[] for _ in fit.effects]
    if len(records) < 2 or not fit.parameters:
        return found
    owner = np.repeat(np.arange(len(records)), [record.rows for record in records])
    steps = np.array([fit.step(np.flatnonzero(owner == k)) for k in range(len(records))])
    for row, (k, parameter) in enumerate(fit.parameters):
        value = fit.effects[k].values[parameter.name]
        own = value + steps[:, row] * parameter.scale
        width = (bounds[row, 1] - bounds[row, 0]) * np.sqrt(len(records))
        spread = float(np.ptp(own))
        if parameter.shape or spread < max(_STRAY * width, _STRAY_SHARE * abs(value)):
            continue
        low, high = int(np.argmin(own)), int(np.argmax(own))
        found[k].append(
            f"the logs disagree on {parameter.name}: {records[low].name} alone says "
            f"{own[low]:.3g}, {records[high].name} {own[high]:.3g} {parameter.unit}".removesuffix(
                " 1"
            )
        )
    return found
