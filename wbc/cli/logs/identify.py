"""`wbc identify`: all parameters of a robot at once, without a search for causes."""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import (
    add_log_options,
    logs_from,
    robot_from,
    table_console,
    working,
    write_json,
)
from wbc.cli.shared.outputs import require_outputs
from wbc.cli.shared.printout import Spoken
from wbc.identification.answer.numbers import plain, with_interval
from wbc.identification.classic import ClassicFit, identify

_EPILOG = """example:
  wbc identify run*.csv --robot planar_leg_fixed --json parameters.json

One linear least squares for base parameters of the links, rotor inertia, viscous and
Coulomb friction and offset of every joint. It says how large each number is, not
which of them are needed: `wbc diagnose` does that."""


_LEGEND = (
    "m is a mass, mx a mass times its centre, Ixx an inertia about the joint's origin. 'with': the "
    "logs tell only the sum of the number and this. What is left is the rms [N m] on parts of the "
    "logs that the fit did not see."
)


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "identify",
        help="all parameters at once: links, rotors, friction",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_log_options(parser)
    parser.add_argument("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Fit, print, write."""
    shown = table_console(options, console)
    require_outputs(options)
    robot = robot_from(options)
    logs = logs_from(options, robot)
    with working(shown, "identifying"):
        fit = identify(robot, logs)
    shown.print(table_of(fit))
    shown.print(_LEGEND)
    shown.print(_errors(fit))
    for warning in fit.warnings:
        shown.print(Spoken(warning), crop=False)
    write_json(options.json, fit.to_json(), console)
    return 0


def table_of(fit: ClassicFit) -> Table:
    """Return the parameters as a table that fits 60 columns: names break, numbers do not."""
    table = Table("parameter", "value", "90 % interval", "drawn", "unit", box=None)
    table.columns[1].justify = table.columns[3].justify = "right"
    # A long name or combination breaks, a number never.
    table.columns[0].overflow = "fold"
    for column in table.columns[1:]:
        column.no_wrap = True
    for p in fit.parameters:
        value, interval = with_interval(p.value, p.low, p.high)
        table.add_row(p.name, value, interval, plain(p.drawn), p.unit)
        if p.combination:
            table.add_row(f"  with {p.combination}")
    return table


def _errors(fit: ClassicFit) -> Table:
    table = Table("left at", "before", "after", box=None)
    for joint, before, after in zip(fit.joints, fit.before, fit.left, strict=True):
        table.add_row(joint, f"{before:.3g}", f"{after:.3g}")
    return table
