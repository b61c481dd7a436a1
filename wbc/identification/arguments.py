"""What a call of compare or diagnose was given: a message where it is not what is meant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from wbc.errors import IdentificationError
from wbc.measurement import (
    Log,
    SuspiciousLogError,
    in_degrees,
    say_so,
    unknown_base,
    unknown_joints,
)
from wbc.robot import Robot

_BEYOND = 3.0  # times the limit of a joint


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


def long_enough(log: Log) -> bool:
    """Return whether a log is long enough to say anything: half a second and 50 rows."""
    return log.duration >= 0.5 and len(log) >= 50


def require_readable(robot: Robot, log: Log) -> None:
    """Check that a log is long enough, and holds every joint's position in the right unit.

    Raises:
        IdentificationError: too short a log, or a position far beyond the joint's limits.
        SuspiciousLogError: a joint without position; the message says what to do.
    """
    if not long_enough(log):
        raise IdentificationError(
            f"{log.source.label}: {log.duration:g} s with {len(log)} rows are too short to say "
            "anything; record at least a few seconds of motion."
        )
    _require_reachable(robot, log)
    unknown = unknown_joints(log, robot) or unknown_base(log, robot)
    if unknown is not None:
        raise SuspiciousLogError(f"{log.source.label}: {unknown.text} {unknown.way_out}", [unknown])


def _require_reachable(robot: Robot, log: Log) -> None:
    """Raise where a joint stands so far beyond its limits that the unit must be another."""
    for name in robot.single_joints:
        row = robot.position_index(name)
        low = float(robot.model.lowerPositionLimit[row])
        high = float(robot.model.upperPositionLimit[row])
        seen = log.column(f"{name}.position") if log.has(f"{name}.position") else np.zeros(1)
        farthest = float(seen[np.argmax(np.abs(seen))])
        if high > low and abs(farthest) > _BEYOND * max(abs(low), abs(high)):
            raise IdentificationError(
                f"{log.source.label}: '{name}.position' reaches {farthest:.3g}, and the joint of "
                f"'{robot.name}' ends at {low:g} and {high:g} rad or m. If the joint turns on, "
                f"widen its limits in the URDF. If the log holds degrees, "
                + say_so(in_degrees(log.columns, [name]))
            )
