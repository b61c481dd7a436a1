"""What a call of compare or diagnose was given: a message where it is not what is meant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from wbc.errors import IdentificationError
from wbc.measurement import Log, SuspiciousLogError, refusal
from wbc.robot import Robot


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
    """Check that something can be said of a robot from a log, see `wbc.measurement.refusal`.

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
