"""`wbc identify`: all parameters of a robot at once, without a search for causes."""

from __future__ import annotations

import argparse

from rich.console import Console

from wbc.cli.inputs import logs_from, robot_from
from wbc.cli.outputs import require_outputs, table_console, working, write_json
from wbc.cli.printout import Spoken, table
from wbc.identification.classic import identify
from wbc.view.rows import fit_rows, parameter_rows

_LEGEND = (
    "m is a mass, mx a mass times its centre, Ixx an inertia about the joint's origin. 'with': the "
    "logs tell only the sum of the number and this. What is left is the rms [N m] on parts of the "
    "logs that the fit did not see."
)


def run(options: argparse.Namespace, console: Console) -> int:
    """Fit, print, write."""
    shown = table_console(options, console)
    require_outputs(options)
    robot = robot_from(options)
    logs = logs_from(options, robot)
    with working(shown, "identifying"):
        fit = identify(robot, logs)
    shown.print(table(parameter_rows(fit)))
    shown.print(_LEGEND)
    shown.print(table(fit_rows(fit)))
    for warning in fit.warnings:
        shown.print(Spoken(warning), crop=False)
    write_json(options.json, fit.to_json(), console)
    return 0
