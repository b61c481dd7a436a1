"""`wbc diagnose --fleet`: many machines, a row each."""

from __future__ import annotations

import argparse
from math import isfinite
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import command_line, robot_from, table_console, watching, write_json
from wbc.cli.shared.outputs import require_parquet
from wbc.cli.shared.printout import Part, print_out
from wbc.errors import WbcError
from wbc.identification.trend import FleetDiagnosis, diagnose_fleet, read_index

_SINGLE = ("save", "report", "fix", "discover")  # options that speak of one machine


def add_fleet_options(parser: argparse.ArgumentParser) -> None:
    """Add the options for many machines."""
    group = parser.add_argument_group("many machines")
    add = group.add_argument
    add("--fleet", metavar="INDEX.csv", help="list of logs: columns log, machine, date")
    add("--out", metavar="FILE.parquet", help="table with a row per machine and date; it grows")
    add("--workers", type=int, default=1, metavar="N", help="processes; -1 for all cores")
    add("--cluster", metavar="ADDRESS", help="Dask scheduler to work on instead")


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


def run_fleet(options: argparse.Namespace, console: Console) -> int:
    """Diagnose every machine, print what they lack; exit code 1 where one has no answer."""
    _require_fleet(options)
    robot_from(options)  # a mistake in the robot is one message, not one per machine
    shown = table_console(options, console)
    names = None if options.add == "auto" else [n.strip() for n in options.add.split(",")]
    with watching("log sets", shown) as watch:
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
    _print(fleet, options, shown)
    shown.print(f"wrote {fleet.path}: {len(fleet.machines)} rows")
    write_json(options.json, fleet.to_json() | {"command": command_line()}, console)
    unanswered = {"unknown", "not_repeatable"} & set(fleet.verdicts)
    return 1 if unanswered or fleet.failed else 0


def _require_fleet(options: argparse.Namespace) -> None:
    if options.logs:
        raise WbcError("wbc diagnose: give logs or --fleet, not both.")
    if not options.out:
        raise WbcError("wbc diagnose --fleet: name the table, --out fleet.parquet.")
    require_parquet(options.out)
    wrong = [f"--{name}" for name in _SINGLE if getattr(options, name)]
    wrong += ["--budget"] if isfinite(options.budget) else []
    if wrong:
        raise WbcError(
            f"{', '.join(wrong)}: for one machine alone. Diagnose that machine without --fleet."
        )


def _print(fleet: FleetDiagnosis, options: argparse.Namespace, console: Console) -> None:
    parts: list[Part] = []
    if fleet.failed:
        lines = [f"not diagnosed: {m.machine} {m.date}: {m.failure}" for m in fleet.failed]
        parts.append(Part("what failed", "\n".join(lines)))
    parts.append(Part("the machines", _table(fleet)))
    print_out(console, [fleet.sentence], parts, quiet=options.quiet, verbose=options.verbose)


def _table(fleet: FleetDiagnosis) -> Any:
    table = Table("machine", "date", "verdict", "causes", box=None)
    table.columns[3].overflow = "fold"
    for machine in fleet.machines:
        if not machine.failure:
            date = machine.date.removesuffix("T00:00:00")
            table.add_row(machine.machine, date, machine.verdict, "\n".join(machine.causes))
    return table
