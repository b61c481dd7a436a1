"""Options and loading that the commands on logs share."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from wbc.cli.shared.printout import add_depth_options
from wbc.effects import load_robot
from wbc.errors import LogError
from wbc.files import write_text
from wbc.identification import Diagnosis, OpenLoop
from wbc.identification.answer.diagnosis.to_do import Commands
from wbc.identification.formulas import Discovery
from wbc.measurement import Log, LogFinding, load_logs, with_machine
from wbc.measurement.columns.map_table import merged, read_table
from wbc.measurement.columns.mend import together, write_map
from wbc.progress import Watch, progress_bar, progress_lines
from wbc.robot import Robot

LOGS = "CSV, Parquet, NPZ, MCAP or bag; LOG@ROBOT if its drives or loads were others"
Reader = Callable[..., tuple[Log, ...]]


def add_log_options(parser: argparse.ArgumentParser, needed: bool = True) -> None:
    """Add the options that name logs and robot; a list may stand in for logs not `needed`."""
    parser.add_argument("logs", nargs="+" if needed else "*", metavar="LOG", help=LOGS)
    parser.add_argument(
        "--robot", required=True, metavar="NAME", help="shipped robot, robot.toml or fitted.toml"
    )
    parser.add_argument("--lossless", action="store_true", help="take the robot with perfect gears")
    parser.add_argument(
        "--columns", metavar="MAP.toml", help="map of column names, units, sides of the gear"
    )
    add_depth_options(parser)
    parser.add_argument(
        "--fix",
        metavar="MAP.toml",
        help="write a column map that corrects wrong columns",
    )


def add_output_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that write results to files."""
    parser.add_argument("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.add_argument(
        "--report", metavar="FILE.html", help="the result as a page for the browser"
    )


def robot_from(options: argparse.Namespace) -> Robot:
    """Return the robot that the options name."""
    robot = load_robot(options.robot)
    return robot.lossless() if options.lossless else robot


def logs_from(options: argparse.Namespace, robot: Robot) -> tuple[Log, ...]:
    """Return the logs that the options name, read with the robot's gear ratios."""
    logs = read_logs(options.logs, options.columns, robot)
    require_one_robot(logs)
    return logs


def read_logs(
    paths: Sequence[str], columns: str | None, robot: Robot, read: Reader = load_logs
) -> tuple[Log, ...]:
    """Return the logs of files, read with the robot's gear ratios.

    Args:
        paths: `LOG`, or `LOG@ROBOT` for logs of a machine with other drives or loads.
        columns: column map.
        robot: that the logs are held against.
        read: how files are read.
    """
    logs: list[Log] = []
    for path in paths:
        file, own = _with_own_robot(path)
        if own is not None and robot.source is not None and robot.source.lossless:
            own = own.lossless()
        found = read([file], columns, gear_ratios=gear_ratios(robot))
        logs += [log if own is None else with_machine(log, robot, own) for log in found]
    return tuple(logs)


def _with_own_robot(path: str) -> tuple[str, Robot | None]:
    """Return (LOG, robot) of `LOG@ROBOT`; a file whose own name holds an @ stays a file."""
    file, mark, name = str(path).rpartition("@")
    if not mark or Path(str(path).partition("#")[0]).exists():
        return str(path), None
    return file, load_robot(name)


def gear_ratios(robot: Robot) -> dict[str, float]:
    """Return N of the driven joints."""
    gears = robot.transmission
    return dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))


def write_fix(
    options: argparse.Namespace, findings: Sequence[LogFinding], console: Console
) -> None:
    """Write the column map that mends what was found, on top of the one in use, if asked to."""
    if getattr(options, "fix", None) is None:
        return
    mend = together(finding.mend for finding in findings if finding.mend)
    if not mend:
        console.print("no column map mends what was found; --fix writes nothing")
        return
    said = [line for finding in findings if finding.mend for line in finding.text.splitlines()]
    path = write_map(options.fix, merged(read_table(options.columns), mend), said)
    console.print(f"wrote {path}; give it with --columns {path}", soft_wrap=True)


def require_one_robot(logs: Sequence[Log]) -> None:
    """Check that logs measure the same joints.

    Raises:
        LogError: one has joints that another one lacks.
    """
    first = _joints(logs[0])
    for log in logs[1:]:
        if _joints(log) != first:
            extra = ", ".join(sorted(_joints(log) ^ first))
            raise LogError(
                f"'{logs[0].source.label}' and '{log.source.label}' are not logs of the same robot:"
                f" only one of them holds {extra}. Compare them one by one."
            )


def _joints(log: Log) -> frozenset[str]:
    return frozenset(name for name in log.names if name.endswith(".position"))


def write_json(target: str | None, content: Mapping[str, Any], console: Console) -> None:
    """Write `content` to a file, or print it when `target` is '-'."""
    if target is None:
        return
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    if target == "-":
        console.out(text, end="")
    else:
        console.print(f"wrote {write_text(Path(target), text)}")


def table_console(options: argparse.Namespace, console: Console) -> Console:
    """Return where tables go: nowhere when the JSON itself is printed."""
    return Console(quiet=True) if options.json == "-" else console


@contextmanager
def watching(what: str, console: Console) -> Iterator[Watch]:
    """Show a bar with the time left; where there is no terminal, lines on standard error."""
    if not console.is_terminal:
        yield progress_lines(what)
        return
    with progress_bar(what, console) as watch:
        yield watch


@contextmanager
def working(console: Console, what: str) -> Iterator[Any]:
    """Show a spinner with a changing line while work goes on; silent when piped."""
    if not console.is_terminal:
        yield lambda line: None
        return
    with console.status(what) as status:
        yield lambda line: status.update(f"{what}: {line}")


def command_line() -> str:
    """Return the command as it was typed, for provenance."""
    return shlex.join(["wbc", *sys.argv[1:]])


def write_report_file(
    options: argparse.Namespace,
    robot: Robot,
    logs: Sequence[Log],
    console: Console,
    diagnosis: Diagnosis | None = None,
    discovery: Discovery | None = None,
    simulated: Sequence[OpenLoop] = (),
    commands: Commands | None = None,
) -> None:
    """Write the HTML report if one was asked for."""
    if options.report is None:
        return
    # Plotly, matplotlib and meshcat take a second to import; only a report needs them.
    from wbc.view.report import write_report

    with working(console, "writing the report"):
        path = write_report(
            options.report,
            robot,
            logs,
            diagnosis,
            command=command_line(),
            discovery=discovery,
            commands=commands,
            simulated=simulated,
        )
    console.print(f"wrote {path}")
