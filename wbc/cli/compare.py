"""`wbc compare`: how far the model is from the logs, and where."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import cache

from rich.console import Console, RenderableType
from rich.text import Text

from wbc.cli.inputs import robot_and_logs
from wbc.cli.outputs import Outcome, command_line, working
from wbc.cli.printout import Part, Spoken, print_out, table
from wbc.effects import load_robot
from wbc.identification import Comparison, compare, rank_robots
from wbc.identification.answer.provenance import provenance
from wbc.identification.open_loop import OpenLoop, open_loop
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.rows import contest_rows, error_rows, open_loop_rows, where_rows

EXIT_ABOVE = 3
"""Exit code of an error above --fail-above."""

Simulated = Callable[[], Sequence[OpenLoop]]
"""Returns the open-loop errors of robots, simulating when it is first called."""


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Compare, print, write."""
    robot, logs = robot_and_logs(options)
    with working(console, "comparing"):
        comparison = compare(robot, logs)
    simulated = simulated_later((robot,), logs, console)
    content = comparison.to_json() | {"provenance": provenance(comparison.sources, command_line())}
    parts = []
    if options.against:
        given = f"{options.robot} (lossless)" if options.lossless else options.robot
        robots = {given: robot, **{name: load_robot(name) for name in options.against}}
        ranked = rank_robots(robots, logs)
        parts.append(Part("the robots", table(contest_rows(ranked))))
        content["robots"] = [contestant.to_json() for contestant in ranked]
    parts.append(Part("the error of every output", table(error_rows(comparison))))
    parts.append(Part("the open-loop error", lambda: open_loop_table(simulated())))
    if comparison.warnings:
        parts.append(Part("warnings", Spoken("\n".join(comparison.warnings))))
    parts.append(Part("where it fails", table(where_rows(comparison))))
    answer = [comparison.sentence]
    print_out(console, answer, parts, quiet=options.quiet, verbose=options.verbose)
    if options.json:
        content["open_loop"] = simulated()[0].to_json()
    if options.report:
        # Plotly, matplotlib and meshcat take a second to import; only a report needs them.
        from wbc.view.report import write_report

        with working(console, "writing the report"):
            path = write_report(
                options.report, robot, logs, command=command_line(), simulated=simulated()
            )
        console.print(f"wrote {path}")
    return _judged(options.fail_above, comparison, console), content


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


def simulated_later(robots: Sequence[Robot], logs: Sequence[Log], console: Console) -> Simulated:
    """Return a function that simulates the logs once, when their errors are first wanted.

    The first simulation after the installation waits about a minute for the compiler. The answer of
    a command does not need it, so it is printed before.
    """

    @cache
    def simulated() -> Sequence[OpenLoop]:
        what = "simulating the logs (the first time, the simulator is compiled: about a minute)"
        with working(console, what):
            return tuple(open_loop(robot, logs) for robot in robots)

    return simulated


def open_loop_table(simulated: Sequence[OpenLoop]) -> RenderableType:
    """Return position errors after each horizon, or why there are none."""
    reason = simulated[-1].reason
    if reason:
        return Text(f"open loop: nothing was simulated: {reason}")
    return table(open_loop_rows(simulated))
