"""What the logs cannot tell, and what must not be believed of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.arguments import require_logs
from wbc.identification.model.fit import Fit, change_along
from wbc.identification.records.folds import ROWS_PER_SAMPLE
from wbc.identification.records.record import Record
from wbc.measurement import Log, find_duplicates
from wbc.robot import Robot
from wbc.robot.coordinates import unit_at

_BASE_MOVES = 5e-3  # [m, rad] between the 5 % and 95 % quantiles: more than a sensor's noise
_SEEN = 0.5  # of a row, below which it is named as hardly seen
_STRAY = 8.0  # standard deviations between the logs' own values
_STRAY_SHARE = 0.05  # of the value itself, less is no disagreement worth a word
_UNSEEN = 1e-7  # of the largest column: rounding


def without_copies(logs: Sequence[Log]) -> tuple[list[Log], list[str]]:
    """Return the logs without copies of one another, and a warning for each copy.

    A copy is no second observation: it would be held out against itself.

    Raises:
        IdentificationError: one log in place of a sequence, or something else than logs.
    """
    require_logs(logs)
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
        moves = record.noise.moving(record.motion.velocity, record.bandwidth)
        moving |= moves[robot.actuated]
    return tuple(n for n, yes in zip(robot.transmission.joints, moving, strict=True) if not yes)


def unmeasured_forces(records: Sequence[Record], outputs: Sequence[str]) -> list[str]:
    """Return what is not seen where contacts touched whose forces no sensor measured.

    Args:
        records: the logs.
        outputs: (m + b,) names of the rows that a model is judged by.
    """
    balances = [record.balance for record in records]
    shares = [balance.seen_share for balance in balances if balance is not None]
    if not shares:
        return []
    names = dict.fromkeys(n for r in records for n, touches in r.active.items() if touches.any())
    seen = np.mean(shares, axis=0)
    lost = [f"{n} {100.0 * s:.0f} %" for n, s in zip(outputs, seen, strict=True) if s < _SEEN]
    return [
        f"no force was measured at {', '.join(names)}: while it touches, its force is what the "
        "balance of the base asks for, and what acts like such a force is not seen"
        + (f". Little is left to judge of {', '.join(lost)}" if lost else "")
        + ". The mass of the robot and its balance show only in the motors' torques; a force "
        "sensor would tell them better. Probabilities are too high without it: of causes stated at "
        "0.95 or more on generated robots, 85 % were there."
    ]


def moving_bases(robot: Robot, logs: Sequence[Log]) -> list[str]:
    """Return a warning if the base moves in logs of a robot whose base is believed to be fixed.

    What a log calls `base`, or a joint whose name begins so, is its base.
    """
    if robot.floating_size:
        return []
    found: dict[str, list[float]] = {}
    labels = []
    for log in logs:
        moves = _base_moves(robot, log)
        labels += [log.source.label] if moves else []
        for owner, distance in moves.items():
            found.setdefault(owner, []).append(distance)
    if not found:
        return []
    listed = ", ".join(f"{owner} by {max(distances):.2g}" for owner, distances in found.items())
    return [
        f"{', '.join(labels)}: the base moves ({listed} m or rad), and that of '{robot.name}' is "
        "fixed: what its motion asks of the joints is taken for something else. Give the robot "
        "with its free base (`wbc list robots`), or hold the base while recording."
    ]


def _base_moves(robot: Robot, log: Log) -> dict[str, float]:
    """Return how far [m, rad] the coordinates of the base move that the robot does not have."""
    moves: dict[str, float] = {}
    for name, values in log.columns.items():
        owner, _, quantity = name.partition(".")
        coordinate = name if owner == "base" else owner
        known = coordinate in robot.joints or not owner.startswith("base")
        if known or quantity.partition(".")[0] not in ("position", "orientation"):
            continue
        distance = float(np.ptp(np.quantile(values, [0.05, 0.95])))
        if distance > _BASE_MOVES:
            moves[coordinate] = distance
    return moves


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
        unit = unit_at(fit.robot, fit.effects[k].where, parameter.unit)
        found[k].append(text if unit == "1" else f"{text} {unit}")
    return found


def _alone(fit: Fit, rows: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the step (p,) to what some rows alone say, and its standard deviation (p,)."""
    step = fit.step(rows)
    left = fit.residual[rows] + change_along(fit.jacobian[rows], step)
    a = fit.jacobian[rows].reshape(-1, len(fit.parameters))
    size = np.sqrt(np.sum(a**2, axis=0))
    seen = size > _UNSEEN * size.max()
    norm = np.where(seen, size, 1.0)
    gram = (a / norm).T @ (a / norm) + 1e-9 * np.eye(norm.size)
    spread = np.sqrt(ROWS_PER_SAMPLE * np.mean(left**2) * np.diag(np.linalg.inv(gram)))
    return step, np.where(seen, spread / norm, np.inf)
