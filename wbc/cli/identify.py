"""`wbc identify`: all parameters of a robot at once, without a search for causes."""

from __future__ import annotations

import argparse

from rich.console import Console

from wbc.cli.inputs import robot_and_logs
from wbc.cli.outputs import Outcome, working
from wbc.cli.printout import Spoken, table
from wbc.identification.classic import identify
from wbc.view.rows import fit_rows, parameter_rows

_LEGEND = (
    "m is a mass, mx a mass times its centre, Ixx an inertia about the joint's origin. 'with': the "
    "logs tell only the sum of the number and this. What is left is the rms [N m] on parts of the "
    "logs that the fit did not see."
)


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Fit, print, write."""
    robot, logs = robot_and_logs(options)
    with working(console, "identifying"):
        fit = identify(robot, logs)
    console.print(table(parameter_rows(fit)))
    console.print(_LEGEND)
    console.print(table(fit_rows(fit)))
    for warning in fit.warnings:
        console.print(Spoken(warning), crop=False)
    return 0, fit.to_json()
