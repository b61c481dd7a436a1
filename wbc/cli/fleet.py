"""`wbc diagnose --fleet`: many machines, a row each."""

from __future__ import annotations

import argparse
from math import isfinite

from rich.console import Console

from wbc.cli.inputs import robot_from
from wbc.cli.outputs import Outcome, command_line, watching
from wbc.cli.printout import Part, print_out, table
from wbc.errors import WbcError
from wbc.identification.trend import diagnose_fleet, read_index
from wbc.view.rows import fleet_rows

_SINGLE = ("save", "report", "fix", "discover")  # options that speak of one machine


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Diagnose every machine, print what they lack; exit code 1 where one has no answer."""
    _require_fleet(options)
    robot_from(options)  # a mistake in the robot is one message, not one per machine
    names = None if options.add == "auto" else [n.strip() for n in options.add.split(",")]
    with watching("log sets", console) as watch:
        fleet = diagnose_fleet(
            options.robot,
            read_index(options.fleet),
            options.out,
            columns=options.columns,
            lossless=options.lossless,
            candidates=names,
            workers=options.workers,
            cluster=options.cluster,
            watch=watch,
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
    wrong += ["--budget"] if isfinite(options.budget) else []
    if wrong:
        raise WbcError(
            f"{', '.join(wrong)}: for one machine alone. Diagnose that machine without --fleet."
        )
