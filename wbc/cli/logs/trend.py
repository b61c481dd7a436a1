"""`wbc trend`: parameters and errors over dates and machines, and which machine drifts."""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import (
    command_line,
    robot_from,
    table_console,
    watching,
    write_json,
)
from wbc.cli.shared.outputs import require_outputs, require_parquet
from wbc.cli.shared.printout import Part, add_depth_options, print_out
from wbc.errors import WbcError
from wbc.identification.answer.numbers import plain, with_deviation
from wbc.identification.trend import Trend, find_runs, follow, read_index

EXIT_DRIFTS = 4
"""Exit code of --fail-on-drift where a machine drifts."""

_EPILOG = """examples:
  wbc trend fleet/*/*.csv --robot fitted.toml --png trend.png
  wbc trend --index runs.csv --robot fitted.toml --workers -1 --json trend.json

The date stands in the file's name or a folder's (2026-03-01); the machine is the
folder, or what stands before the date where all files lie in one folder. An
index has the columns log, machine, date. The effects of the robot are fitted to
every session anew; a session is all logs of one machine with one date."""


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "trend",
        help="parameters and errors over dates and machines: which drifts",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("logs", nargs="*", metavar="LOG", help="CSV, Parquet, NPZ, MCAP or bag")
    add("--index", metavar="FILE.csv", help="list of logs: columns log, machine, date")
    add("--robot", required=True, metavar="NAME", help="shipped robot, robot.toml or fitted.toml")
    add("--lossless", action="store_true", help="start from the robot with perfect gears")
    add("--columns", metavar="MAP.toml", help="foreign column names, units, side of the gear")
    add("--workers", type=int, default=1, metavar="N", help="processes; -1 for all cores")
    add("--cluster", metavar="ADDRESS", help="Dask scheduler to work on instead")
    add(
        "--out",
        metavar="FILE.parquet",
        help="table of sessions; given again, only new sessions are measured",
    )
    add("--fail-on-drift", action="store_true", help="exit code 4 if a machine drifts")
    add_depth_options(parser)
    add("--png", metavar="FILE", help="plot of every quantity over time")
    add("--theme", choices=("light", "dark"), default="light", help="colours of the plot")
    add("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Measure every session, print what drifts, write plot and JSON."""
    require_outputs(options)
    require_parquet(options.out)
    robot_from(options)  # a mistake in the robot is one message, not one per session
    runs = find_runs(options.logs)
    if options.index:
        runs += read_index(options.index)
    if not runs:
        raise WbcError("wbc trend: no log was given; name them, or a list with --index FILE.csv.")
    shown = table_console(options, console)
    with watching("sessions", shown) as watch:
        trend = follow(
            options.robot,
            runs,
            columns=options.columns,
            lossless=options.lossless,
            workers=options.workers,
            cluster=options.cluster,
            watch=watch,
            out=options.out,
        )
    _print(trend, options, shown)
    content = trend.to_json() | {"command": command_line()}
    write_json(options.json, content, console)
    if options.png:
        from wbc.view import DARK, LIGHT
        from wbc.view.plots import trend_figure, write_figure

        figure = trend_figure(trend, DARK if options.theme == "dark" else LIGHT)
        shown.print(f"wrote {write_figure(options.png, figure)}")
    return EXIT_DRIFTS if options.fail_on_drift and trend.drifting else 0


def _print(trend: Trend, options: argparse.Namespace, console: Console) -> None:
    parts = []
    if trend.drifting:
        parts.append(Part("what drifts", _table(trend, drifting=True)))
    failed = [s for s in trend.sessions if s.failure]
    if failed:
        lines = [f"not measured: {s.machine} {s.date}: {s.failure}" for s in failed]
        parts.append(Part("sessions that could not be measured", "\n".join(lines)))
    parts.append(Part("what does not surely drift", _table(trend, drifting=False)))
    print_out(console, [trend.sentence], parts, quiet=options.quiet, verbose=options.verbose)


def _table(trend: Trend, drifting: bool) -> Table:
    # A large change with few sessions may be chance: what is listed second need not stay.
    head = "drifts" if drifting else "no sure drift"
    table = Table(head, "", "first", "last", "change", "", box=None)
    table.columns[0].overflow = "fold"
    for column in table.columns[2:5]:
        column.justify = "right"
    for drift in trend.drifts:
        if drift.drifts != drifting:
            continue
        change = with_deviation(drift.change, drift.deviation)
        unit = "" if drift.unit == "1" else drift.unit
        first, last = plain(drift.first.value), plain(drift.last.value)
        table.add_row(drift.machine, drift.name, first, last, change, unit)
    if drifting:
        table.caption = "change: of the line through all sessions, ± standard error"
    return table
