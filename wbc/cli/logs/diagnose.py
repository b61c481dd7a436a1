"""`wbc diagnose`: which physical effect the model lacks."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from wbc.cli.logs.discovery import print_discovery
from wbc.cli.logs.fleet import add_fleet_options, require_no_fleet, run_fleet
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
from wbc.cli.shared.open_loop import Simulated, open_loop_table, simulated_later
from wbc.cli.shared.outputs import require_outputs
from wbc.cli.shared.printout import Part, Spoken, print_out
from wbc.effects import effect_class, save_robot
from wbc.errors import EffectError
from wbc.identification import Diagnosis, diagnose
from wbc.identification.answer.diagnosis.sentence import (
    MEANINGS,
    verdict_sentence,
)
from wbc.identification.answer.diagnosis.to_do import Commands, what_to_do
from wbc.identification.answer.numbers import efforts, plain, sure, with_deviation, with_interval
from wbc.identification.answer.provenance import provenance
from wbc.identification.formulas import discover
from wbc.measurement import Log
from wbc.measurement.guessing.robot_guess import guessed_numbers
from wbc.robot import Effect, Robot

_RANKED = 5  # rows of the ranking that are printed; --verbose and --json have all of them

_Intervals = Mapping[tuple[str, str, str], tuple[float, float]]

_EPILOG = """example:
  wbc diagnose run*.csv --robot planar_leg_fixed --lossless --save fitted.toml

--add auto considers every effect there is (`wbc list effects`);
--add NAME,NAME only these.

many machines, a row each; given again, an interrupted run goes on:
  wbc diagnose --fleet runs.csv --robot leg.toml --out fleet.parquet --workers 4"""


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "diagnose",
        help="which physical effect the model lacks; add it, save it",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_log_options(parser, needed=False)
    add_fleet_options(parser)
    parser.add_argument(
        "--add", default="auto", metavar="auto|NAME,...", help="effects to consider (default auto)"
    )
    parser.add_argument(
        "--save", metavar="FILE.toml", help="write the robot with the effects found"
    )
    parser.add_argument(
        "--budget",
        type=float,
        default=inf,
        metavar="SECONDS",
        help="end the search after this time with the best answer so far (as Ctrl-C does)",
    )
    parser.add_argument(
        "--discover",
        action="store_true",
        help="propose formulas for what no effect explains (--save then writes them, too)",
    )
    add_output_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Diagnose, print, write; exit code 1 when the cause stays unknown or runs do not repeat."""
    shown = table_console(options, console)
    require_outputs(options)
    if options.fleet:
        return run_fleet(options, console)
    require_no_fleet(options)
    robot = robot_from(options)
    candidates = _candidates(options.add)
    logs = logs_from(options, robot)
    with working(shown, "diagnosing") as progress:
        diagnosis = diagnose(robot, logs, candidates, progress, options.budget)
    diagnosis = _with_guesses(diagnosis, options.robot)
    if options.save and not options.discover:
        # Before the logs are simulated, which takes a minute the first time: nobody loses it then.
        _save(options.save, diagnosis.robot, diagnosis.intervals(), logs)
    robots = (robot, diagnosis.robot) if diagnosis.findings else (robot,)
    simulated = simulated_later(robots, logs, shown)
    commands = _commands(options)
    print_diagnosis(
        shown,
        diagnosis,
        commands,
        simulated,
        quiet=options.quiet,
        verbose=options.verbose,
    )
    content, discovery = diagnosis.to_json(), None
    if options.discover:
        with working(shown, "discovering") as progress:
            discovery = discover(robot, logs, progress, diagnosis.effects)
        print_discovery(shown, discovery)
        content["discovery"] = discovery.to_json()
        if options.save:
            found = discovery if discovery.proposals else diagnosis
            known = discovery.intervals if discovery.proposals else diagnosis.intervals()
            _save(options.save, found.robot, known, logs)
    if options.save:
        something = diagnosis.effects or (discovery is not None and discovery.proposals)
        as_it_was = "" if something else ": the robot as given, no effect was added"
        shown.print(f"wrote {options.save}{as_it_was}", soft_wrap=True)
    if options.json:
        before, *after = (one.to_json() for one in simulated())
        content["open_loop"] = {"before": before, "after": after[0] if after else before}
        content["provenance"] = provenance(diagnosis.sources, command_line())
        write_json(options.json, content, console)
    if options.report:
        write_report_file(options, robot, logs, shown, diagnosis, discovery, simulated(), commands)
    return 1 if diagnosis.verdict in ("unknown", "not_repeatable") else 0


def _commands(options: argparse.Namespace) -> Commands:
    return Commands.of(
        options.logs,
        options.robot,
        saved=options.save,
        lossless=options.lossless,
        columns=options.columns,
        add=options.add,
    )


def _save(path: str, robot: Robot, intervals: _Intervals, logs: Sequence[Log]) -> None:
    """Write a robot with the effects found, and what they come from."""
    facts = {
        "logs": ", ".join(f"{log.source.label} {log.source.sha256[:16]}" for log in logs),
        "command": command_line(),
    }
    save_robot(robot, path, intervals, facts)


def _with_guesses(diagnosis: Diagnosis, robot: str) -> Diagnosis:
    """Return a diagnosis that says which numbers of the robot nobody has looked up yet."""
    guessed = guessed_numbers(robot)
    if not guessed:
        return diagnosis
    first = (
        f"Look up {', '.join(guessed)} in {robot}: they are still guesses of `wbc init`, and every "
        "answer rests on them."
    )
    # What to do now is printed for every verdict, but for these two it is not the next experiment.
    if diagnosis.verdict in ("named", "none"):
        return replace(diagnosis, warnings=(first, *diagnosis.warnings))
    return replace(diagnosis, next_experiment=f"{first} {diagnosis.next_experiment}")


def _candidates(choice: str) -> list[type[Effect]] | None:
    if choice == "auto":
        return None
    names = [name.strip() for name in choice.split(",") if name.strip()]
    if not names:
        raise EffectError("--add names no effect; 'auto' considers all (wbc list effects).")
    return [effect_class(name) for name in names]


def print_diagnosis(
    console: Console,
    diagnosis: Diagnosis,
    commands: Commands | None = None,
    simulated: Simulated | None = None,
    *,
    quiet: bool = False,
    verbose: bool = False,
) -> None:
    """Print the answer in a sentence, what to do now, then as much of the detail as fits.

    Args:
        console: where.
        diagnosis: the answer.
        commands: how to go on from it on the command line.
        simulated: returns the open-loop errors of the robot as given and with the effects found.
        quiet: print the answer alone.
        verbose: print all of the detail.
    """
    answer: list[RenderableType] = [
        Text(f"verdict: {diagnosis.verdict} ({MEANINGS[diagnosis.verdict]})", style="bold"),
        verdict_sentence(diagnosis),
    ]
    answer.append(Spoken(f"do this now: {what_to_do(diagnosis, commands)}"))
    parts = [Part("what is left", _outputs_table(diagnosis))]
    if diagnosis.findings:
        parts.insert(0, Part("what was found", _effects_table(diagnosis)))
    for name, text in (
        ("what the rest looks like", diagnosis.remainder),
        ("warnings", "\n".join(diagnosis.warnings)),
    ):
        parts += [Part(name, Spoken(text))] if text else []
    if simulated:
        parts.append(Part("the open-loop error", lambda: open_loop_table(simulated())))
    if diagnosis.findings:
        parts.append(Part("how the error falls", _steps_table(diagnosis)))
    if len(diagnosis.ranking) > 1:
        parts.append(Part("what else was tried", _ranking_table(diagnosis, verbose)))
    print_out(console, answer, parts, quiet=quiet, verbose=verbose)


def _outputs_table(diagnosis: Diagnosis) -> Table:
    table = Table("left at", "before", "after", "attainable", "noise floor", "", box=None)
    for column in table.columns[1:5]:
        column.justify = "right"
    for o in diagnosis.outputs:
        numbers = (plain(x, 2) for x in (o.before, o.after, o.attainable, o.floor))
        table.add_row(o.output, *numbers, o.unit if o.judged else f"{o.unit}, set aside")
    table.caption = (
        f"rms {efforts(o.unit for o in diagnosis.outputs)} that the model does not explain; "
        "attainable: what the best model of the motion would leave; noise floor: what noise leaves"
    )
    return table


def _effects_table(diagnosis: Diagnosis) -> Table:
    """Return the effects found; one with a single number takes a single line."""
    table = Table("effect at place", "value", "90 % interval", "unit", "is it there?", box=None)
    table.columns[0].overflow = "fold"
    table.columns[1].justify = "right"
    for finding in diagnosis.findings:
        name, certainty = f"{finding.effect.name} at {finding.effect.where}", ""
        alone = len(finding.numbers) == 1
        if alone:
            certainty = sure(finding.probability)
        else:
            table.add_row(name, "", "", "", sure(finding.probability))
        for number, e in finding.numbers.items():
            value, interval = with_interval(e.value, e.low, e.high)
            unit = "" if e.unit == "1" else e.unit
            table.add_row(name if alone else f"  {number}", value, interval, unit, certainty)
            if e.drawn is not None:
                table.add_row("  as given" if alone else "    as given", plain(e.drawn))
        if finding.alternatives:
            table.add_row("  or " + ", or ".join(finding.rivals))
        for warning in finding.warnings:
            table.add_row(f"  warning: {warning}")
    return table


def _steps_table(diagnosis: Diagnosis) -> Table:
    table = Table("added", "where", "held-out error", box=None)
    table.columns[2].justify = "right"
    for step in diagnosis.steps:
        table.add_row(step.added or "(the model as given)", step.where, plain(step.error, 2))
    table.caption = f"in noise floors (floor from {diagnosis.error.floor_source})"
    return table


def _ranking_table(diagnosis: Diagnosis, whole: bool) -> Table:
    """Return the models tried, with what they leave beyond the one found."""
    table = Table("what else was tried", "error", "beyond it", "", box=None)
    for column in table.columns[1:3]:
        column.justify = "right"
    tried = [row for row in diagnosis.ranking if row.standing != "found"]
    for row in tried if whole else tried[:_RANKED]:
        table.add_row(row.text, plain(row.error, 2), with_deviation(*row.beyond), row.judgement)
    if len(tried) > _RANKED and not whole:
        table.add_row(f"and {len(tried) - _RANKED} more (--verbose)")
    table.caption = (
        "most probable first; error: held out, in noise floors; beyond it: minus the error of what "
        "was found, ± standard error; `wbc list effects` explains the names"
    )
    return table
