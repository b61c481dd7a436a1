"""Robots, logs and column maps as the options name them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from wbc.cli.outputs import Options
from wbc.effects import load_robot
from wbc.errors import LogError
from wbc.identification.readings import with_machine
from wbc.measurement import Log, LogFinding, load_logs, write_map
from wbc.measurement.column_map import SECTIONS, merged, parse_column_map, read_table, together
from wbc.robot import Robot


def robot_from(options: Options) -> Robot:
    """Return the robot that the options name."""
    robot = load_robot(options.robot)
    return robot.lossless() if options.lossless else robot


def robot_and_logs(options: Options) -> tuple[Robot, tuple[Log, ...]]:
    """Return the robot and the logs that the options name, read with its gear ratios.

    Raises:
        LogError: one has joints that another one lacks.
    """
    robot = robot_from(options)
    logs = read_logs(options.logs, options.columns, robot)
    held = [{name for name in log.names if name.endswith(".position")} for log in logs]
    for log, own in zip(logs, held, strict=True):
        if extra := ", ".join(sorted(own ^ held[0])):
            both = f"'{logs[0].source.label}' and '{log.source.label}'"
            why = f"only one of them holds {extra}. Compare them one by one."
            raise LogError(f"{both} are not logs of the same robot: {why}")
    return robot, logs


def read_logs(paths: Sequence[str], columns: str | None, robot: Robot) -> tuple[Log, ...]:
    """Return the logs of files, read with the robot's gear ratios.

    Args:
        paths: `LOG`; `LOG@ROBOT` for logs of a machine with other drives or loads; `LOG@MAP.toml`
            for a log that is read as the column map says and then changed by one of its own.
        columns: column map.
        robot: that the logs are held against.
    """
    gears = robot.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    logs: list[Log] = []
    for path in paths:
        file, own, patch = _with_own(path)
        if own is not None and robot.source is not None and robot.source.lossless:
            own = own.lossless()
        table = merged(read_table(columns), read_table(patch))
        found = load_logs([file], parse_column_map(table, patch or columns or "", ratios))
        logs += [log if own is None else with_machine(log, robot, own) for log in found]
    return tuple(logs)


def _with_own(path: str) -> tuple[str, Robot | None, str | None]:
    """Return (LOG, robot, map) of `LOG@ROBOT` or `LOG@MAP.toml`, which changes the map of all.

    A file whose own name holds an @ stays a file.
    """
    file, mark, name = str(path).rpartition("@")
    if not mark or Path(str(path).partition("#")[0]).exists():
        return str(path), None, None
    if name.endswith(".toml") and Path(name).is_file() and set(read_table(name)) <= set(SECTIONS):
        return file, None, name
    return file, load_robot(name), None


def write_fix(options: Options, findings: Sequence[LogFinding], console: Console) -> None:
    """Write the column map that mends what was found, on top of the one in use, if asked to."""
    if getattr(options, "fix", None) is None:
        return
    shared = [finding for finding in findings if finding.mend and not finding.alone]
    if any(finding.mend and finding.alone for finding in findings):
        console.print("what only some of the logs have, --fix does not write: see the lines above")
    if not (mend := together(finding.mend for finding in shared)):
        console.print("no column map mends what was found; --fix writes nothing")
        return
    said = [line for finding in shared for line in finding.text.splitlines()]
    path = write_map(options.fix, merged(read_table(options.columns), mend), said)
    console.print(f"wrote {path}; give it with --columns {path}", soft_wrap=True)
