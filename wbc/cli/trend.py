"""`wbc trend`: which of many machines drifts."""

from __future__ import annotations

import argparse
from functools import partial

from rich.console import Console

from wbc.cli.inputs import robot_from
from wbc.cli.outputs import Outcome, command_line, watching, write_figures
from wbc.cli.printout import Part, print_out, table
from wbc.errors import WbcError
from wbc.identification.trend import find_runs, follow, read_index
from wbc.view.rows import drift_rows

EXIT_DRIFTS = 4
"""Exit code of --fail-on-drift where a machine drifts."""


def run_trend(options: argparse.Namespace, console: Console) -> Outcome:
    """Measure every session, print what drifts, write plot and JSON."""
    robot_from(options)  # a mistake in the robot is one message, not one per session
    runs = find_runs(options.logs)
    if options.index:
        runs += read_index(options.index)
    if not runs:
        raise WbcError("wbc trend: no log was given; name them, or a list with --index FILE.csv.")
    given = {k: getattr(options, k) for k in ("columns", "lossless", "workers")}
    with watching("sessions", console) as watch:
        trend = follow(options.robot, runs, watch=watch, **given)
    parts = []
    if trend.drifting:
        parts.append(Part("what drifts", table(drift_rows(trend, True))))
    if failed := [s for s in trend.sessions if s.failure]:
        lines = [f"not measured: {s.machine} {s.date}: {s.failure}" for s in failed]
        parts.append(Part("sessions that could not be measured", "\n".join(lines)))
    parts.append(Part("what does not surely drift", table(drift_rows(trend, False))))
    print_out(console, [trend.sentence], parts, quiet=options.quiet, verbose=options.verbose)
    if options.png:
        from wbc.view.plots import trend_figure

        write_figures(options, {options.png: partial(trend_figure, trend)}, console)
    code = EXIT_DRIFTS if options.fail_on_drift and trend.drifting else 0
    return code, trend.to_json() | {"command": command_line()}
