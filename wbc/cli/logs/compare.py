"""`wbc compare`: how far the model is from the logs, and where."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import (
    add_log_options,
    add_output_options,
    command_line,
    logs_from,
    robot_from,
    table_console,
    working,
    write_json,
    write_report_file,
)
from wbc.cli.shared.open_loop import open_loop_table, simulated_later
from wbc.cli.shared.outputs import require_outputs
from wbc.cli.shared.printout import Part, Spoken, print_out
from wbc.effects import load_robot
from wbc.identification import Comparison, Contestant, compare, rank_robots
from wbc.identification.answer.numbers import efforts, plain, with_deviation
from wbc.identification.answer.provenance import provenance

EXIT_ABOVE = 3
"""Exit code of an error above --fail-above."""


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "compare",
        help="error of the model on logs: how much, and where",
        epilog="example: wbc compare run*.csv --robot planar_leg_fixed --lossless",
    )
    add_log_options(parser)
    parser.add_argument(
        "--against",
        nargs="+",
        default=[],
        metavar="NAME",
        help="other robots to rank on the same logs",
    )
    parser.add_argument(
        "--fail-above",
        type=_limit,
        metavar="LIMIT",
        help="exit code 3 if the error is above: 0.5Nm (any output's rms), or 3 (noise floors)",
    )
    add_output_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Compare, print, write."""
    shown = table_console(options, console)
    require_outputs(options)
    robot = robot_from(options)
    logs = logs_from(options, robot)
    with working(shown, "comparing"):
        comparison = compare(robot, logs)
    simulated = simulated_later((robot,), logs, shown)
    parts = [
        Part("the error of every output", error_table(comparison)),
        Part("the open-loop error", lambda: open_loop_table(simulated())),
        *(
            [Part("warnings", Spoken("\n".join(comparison.warnings)))]
            if comparison.warnings
            else []
        ),
        Part("where it fails", where_table(comparison)),
    ]
    content = comparison.to_json() | {"provenance": provenance(comparison.sources, command_line())}
    if options.against:
        given = f"{options.robot} (lossless)" if options.lossless else options.robot
        robots = {given: robot, **{name: load_robot(name) for name in options.against}}
        ranked = rank_robots(robots, logs)
        parts.insert(0, Part("the robots", contest_table(ranked)))
        content["robots"] = [contestant.to_json() for contestant in ranked]
    answer = [comparison.sentence]
    print_out(shown, answer, parts, quiet=options.quiet, verbose=options.verbose)
    if options.json:
        content["open_loop"] = simulated()[0].to_json()
        write_json(options.json, content, console)
    if options.report:
        write_report_file(options, robot, logs, shown, simulated=simulated())
    return _judged(options.fail_above, comparison, shown)


def _limit(text: str) -> tuple[float, str]:
    """Return (size, unit) of a limit; the unit is empty for noise floors."""
    found = re.fullmatch(r"([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(floors?|N\s*m|N)?", text.strip())
    try:
        size = float(found[1]) if found else 0.0
    except ValueError:
        size = 0.0
    if found is None or not size > 0.0:
        raise argparse.ArgumentTypeError(
            f"'{text}' is no limit; give 0.5Nm (or N), or a number of noise floors such as 3"
        )
    unit = (found[2] or "").replace(" ", "")
    return size, "" if unit.startswith("floor") else unit


def _judged(limit: tuple[float, str] | None, comparison: Comparison, console: Console) -> int:
    """Return the exit code: 3 where the error is above the limit, and say where."""
    if limit is None:
        return 0
    size, unit = limit
    if not unit:
        above = comparison.error > size
        error = f"{comparison.error:.3g} noise floors"
    else:
        worst = max(comparison.outputs, key=lambda output: output.rms)
        above = worst.rms > size
        error = f"{worst.rms:.3g} {worst.unit} at {worst.output}"
    named = f"{size:g} {unit or 'noise floors'}"
    console.print(f"{'above' if above else 'not above'} {named}: {error}")
    return EXIT_ABOVE if above else 0


def error_table(comparison: Comparison) -> Table:
    """Return the residual of every output against its floor."""
    table = Table(
        "output",
        "unit",
        "residual",
        "measured",
        "floor",
        "x floor",
        box=None,
        title="error",
    )
    for column in table.columns[2:]:
        column.justify = "right"
    for o in comparison.outputs:
        size = "" if o.size != o.size else plain(o.size)
        table.add_row(
            o.output,
            o.unit,
            plain(o.rms, 2),
            size,
            plain(o.floor, 2),
            plain(o.ratio, 2),
        )
    reported = efforts(o.unit for o in comparison.outputs)
    table.caption = f"rms {reported} over all logs; residual: measured - model; floor: noise"
    return table


def contest_table(ranked: Sequence[Contestant]) -> Table:
    """Return robots beside the best of them."""
    table = Table("", "robot", "error", "worse by", "numbers", "", box=None, title="robots")
    for column in table.columns[2:5]:
        column.justify = "right"
    for c in ranked:
        table.add_row(
            str(c.rank),
            c.name,
            plain(c.error),
            "" if c.standing == "best" else with_deviation(c.difference, c.deviation),
            str(c.parameters),
            "; ".join((c.standing, *c.warnings)),
        )
    table.caption = "error: rms in floors; worse by: mean square against the best, standard error"
    return table


def where_table(comparison: Comparison, most: int = 8) -> Table:
    """Return the strongest dependences of the residual."""
    table = Table(
        "output", "depends on", "unit", "share", "from", "to", box=None, title="where it fails"
    )
    for column in table.columns[3:]:
        column.justify = "right"
    for b in comparison.where[:most]:
        low, high = int(b.mean.argmin()), int(b.mean.argmax())
        table.add_row(
            b.output,
            b.variable,
            b.unit,
            f"{100.0 * b.share:.0f} %",
            f"{b.mean[low]:+.2g} at {b.center[low]:.2g}",
            f"{b.mean[high]:+.2g} at {b.center[high]:.2g}",
        )
    table.caption = "share of the residual's variance that its mean over this variable explains"
    return table
