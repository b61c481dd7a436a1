"""Many machines: `wbc diagnose --fleet`, a row each, and `wbc trend`, which of them drifts."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

from rich.console import Console

from wbc.cli.inputs import robot_from
from wbc.cli.outputs import Outcome, command_line, watching, write_figures
from wbc.cli.printout import Part, print_out, table
from wbc.errors import WbcError
from wbc.identification.trend import diagnose_fleet, find_runs, follow, read_index
from wbc.view.rows import drift_rows, fleet_rows

_SINGLE = ("save", "report", "fix", "discover", "budget")  # options that speak of one machine
EXIT_DRIFTS = 4
"""Exit code of --fail-on-drift where a machine drifts."""


def run_fleet(options: argparse.Namespace, console: Console) -> Outcome:
    """Diagnose every machine, print what they lack; exit code 1 where one has no answer."""
    _require_fleet(options)
    robot_from(options)  # a mistake in the robot is one message, not one per machine
    names = None if options.add == "auto" else [n.strip() for n in options.add.split(",")]
    with watching("log sets", console) as watch:
        runs, given = read_index(options.fleet), _given(options)
        fleet = diagnose_fleet(
            options.robot, runs, options.out, candidates=names, watch=watch, **given
        )
    parts: list[Part] = []
    if fleet.failed:
        lines = [f"not diagnosed: {m.machine} {m.date}: {m.failure}" for m in fleet.failed]
        parts.append(Part("what failed", "\n".join(lines)))
    parts.append(Part("the machines", table(fleet_rows(fleet))))
    print_out(console, [fleet.sentence], parts, quiet=options.quiet, verbose=options.verbose)
    console.print(f"wrote {fleet.path}: {len(fleet.machines)} rows")
    unanswered = {"unknown", "not_repeatable"} & set(fleet.verdicts)
    content = fleet.to_json() | {"command": command_line()}
    return int(bool(unanswered or fleet.failed)), content


def _given(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of both commands, as the functions behind them take them."""
    return {k: getattr(options, k) for k in ("columns", "lossless", "workers", "cluster")}


def require_no_fleet(options: argparse.Namespace) -> None:
    """Check that logs were given and nothing that only a fleet has.

    Raises:
        WbcError: no log, or an option that needs --fleet.
    """
    if options.out or options.cluster or options.workers != 1:
        raise WbcError("--out, --workers and --cluster are for many machines: give --fleet too.")
    if not options.logs:
        raise WbcError(
            "wbc diagnose: no log was given; name them, or a list with --fleet FILE.csv."
        )


def _require_fleet(options: argparse.Namespace) -> None:
    if options.logs:
        raise WbcError("wbc diagnose: give logs or --fleet, not both.")
    if not options.out:
        raise WbcError("wbc diagnose --fleet: name the table, --out fleet.parquet.")
    wrong = [f"--{name}" for name in _SINGLE if getattr(options, name)]
    if wrong:
        raise WbcError(
            f"{', '.join(wrong)}: for one machine alone. Diagnose that machine without --fleet."
        )


def run_trend(options: argparse.Namespace, console: Console) -> Outcome:
    """Measure every session, print what drifts, write plot and JSON."""
    robot_from(options)  # a mistake in the robot is one message, not one per session
    runs = find_runs(options.logs)
    if options.index:
        runs += read_index(options.index)
    if not runs:
        raise WbcError("wbc trend: no log was given; name them, or a list with --index FILE.csv.")
    with watching("sessions", console) as watch:
        trend = follow(options.robot, runs, watch=watch, out=options.out, **_given(options))
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
