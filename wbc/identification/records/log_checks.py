"""What is refused of robots and logs, and what is warned of: copies, rests, bases that move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from wbc.errors import IdentificationError
from wbc.identification.readings import SuspiciousLogError, find_duplicates, refusal
from wbc.identification.records.record import Record
from wbc.measurement import Log
from wbc.robot import Robot

_BASE_MOVES = 5e-3  # [m, rad] between the 5 % and 95 % quantiles: more than a sensor's noise
_SEEN = 0.5  # of a row, below which it is named as hardly seen


def require_robot_and_logs(robot: Robot, logs: Sequence[Log]) -> None:
    """Check the kinds of the arguments, and that the robot has gears.

    Raises:
        IdentificationError: a name in place of a robot, one log in place of a sequence, something
            else in place of a log, or a robot whose description has no gears.
    """
    if not isinstance(robot, Robot):
        raise IdentificationError(
            f"a robot is expected first, not {robot!r}; load it with load_robot(...)."
        )
    require_logs(logs)
    if not robot.transmission.size:
        raise IdentificationError(
            f"'{robot.name}' has no gears, so no joint is driven and nothing can be compared; "
            "describe each driven joint in robot.toml:\n"
            "    [gears.JOINT]\n"
            '    gear_ratio = { value = VALUE, unit = "1", source = "data sheet" }\n'
            '    rotor_inertia = { value = VALUE, unit = "kg m^2", source = "data sheet" }'
        )


def require_logs(logs: Sequence[Log]) -> None:
    """Check that logs are a sequence of logs.

    Raises:
        IdentificationError: one log in place of a sequence, or something else in place of a log.
    """
    if isinstance(logs, Log):
        raise IdentificationError("a sequence of logs is expected; give one log as [log].")
    if isinstance(logs, str | Path) or not isinstance(logs, Iterable):
        raise IdentificationError(
            f"logs are expected, not {str(logs)!r}; read files with load_logs([...])."
        )
    for log in logs:
        if not isinstance(log, Log):
            raise IdentificationError(
                f"a log is expected, not {log!r}; read files with load_logs([...])."
            )


def require_readable(robot: Robot, log: Log) -> None:
    """Check that something can be said of a robot from a log, see `refusal`.

    Raises:
        IdentificationError: too short a log.
        SuspiciousLogError: a joint or a free base without a place, or a position far beyond the
            joint's limits; the message says what to do.
    """
    found = refusal(log, robot)
    if found is not None and found.kind == "short":
        raise IdentificationError(f"{log.source.label}: {found.text} {found.way_out}")
    if found is not None:
        column = f"{found.column}: " if found.column else ""
        message = f"{log.source.label}: {column}{found.text} {found.way_out}"
        raise SuspiciousLogError(message, [found])


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


def low_passed_torques(records: Sequence[Record]) -> list[str]:
    """Return a warning where a low-pass took the noise of torques away, empty where none did."""
    joints = np.array(records[0].robot.transmission.joints)
    passed = np.array([record.noise.passed for record in records])
    filtered = np.isfinite(passed).any(axis=0)
    if not filtered.any():
        return []
    named = "all joints" if filtered.all() else ", ".join(joints[filtered])
    most = np.max(passed[np.isfinite(passed)])
    return [
        f"the torques of {named} hold nothing faster than {most:.2g} Hz: a low-pass took their "
        "noise away. The noise floor is what they hold there, which may be more than noise. Logs "
        "without the filter, or one motion recorded twice, would tell it."
    ]


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
