"""`wbc diagnose`: which physical effect the model lacks."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

from rich.console import Console, RenderableType
from rich.text import Text

from wbc.cli import fleet
from wbc.cli.compare import Simulated, open_loop_table, simulated_later
from wbc.cli.inputs import robot_and_logs
from wbc.cli.outputs import Outcome, command_line, working
from wbc.cli.printout import Part, Spoken, print_out, table
from wbc.effects import effect_class, save_robot
from wbc.errors import EffectError
from wbc.identification import Diagnosis, diagnose
from wbc.identification.answer.diagnosis.sentence import MEANINGS, verdict_sentence
from wbc.identification.answer.diagnosis.to_do import Commands, what_to_do
from wbc.identification.answer.provenance import provenance
from wbc.identification.formulas import Discovery, discover
from wbc.measurement import Log
from wbc.measurement.guess import guessed_numbers
from wbc.robot import Effect, Robot
from wbc.view.rows import effect_rows, formula_rows, left_rows, ranking_rows, step_rows

_Intervals = Mapping[tuple[str, str, str], tuple[float, float]]


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Diagnose, print, write; exit code 1 when the cause stays unknown or runs do not repeat."""
    begun = time.monotonic()
    if options.fleet:
        return fleet.run(options, console)
    fleet.require_no_fleet(options)
    candidates = _candidates(options.add)
    robot, logs = robot_and_logs(options)
    with working(console, "diagnosing") as progress:
        left = begun + options.budget - time.monotonic()
        diagnosis = diagnose(robot, logs, candidates, progress, left)
    diagnosis = _with_guesses(diagnosis, options.robot)
    if options.save and not options.discover:
        # Before the logs are simulated, which takes a minute the first time: nobody loses it then.
        _save(options.save, diagnosis.robot, diagnosis.intervals(), logs)
    robots = (robot, diagnosis.robot) if diagnosis.findings else (robot,)
    simulated = simulated_later(robots, logs, console)
    commands = Commands.of(
        options.logs,
        options.robot,
        saved=options.save,
        lossless=options.lossless,
        columns=options.columns,
        add=options.add,
    )
    print_diagnosis(
        console, diagnosis, commands, simulated, quiet=options.quiet, verbose=options.verbose
    )
    content, discovery = diagnosis.to_json(), None
    if options.discover:
        with working(console, "discovering") as progress:
            discovery = discover(robot, logs, progress, diagnosis.effects)
        _print_discovery(console, discovery)
        content["discovery"] = discovery.to_json()
        if options.save:
            found = discovery if discovery.proposals else diagnosis
            known = discovery.intervals if discovery.proposals else diagnosis.intervals()
            _save(options.save, found.robot, known, logs)
    if options.save:
        something = diagnosis.effects or (discovery is not None and discovery.proposals)
        as_it_was = "" if something else ": the robot as given, no effect was added"
        console.print(f"wrote {options.save}{as_it_was}", soft_wrap=True)
    if options.json:
        before, *after = (one.to_json() for one in simulated())
        content["open_loop"] = {"before": before, "after": after[0] if after else before}
        content["provenance"] = provenance(diagnosis.sources, command_line())
    if options.report:
        # Plotly, matplotlib and meshcat take a second to import; only a report needs them.
        from wbc.view.report import write_report

        with working(console, "writing the report"):
            path = write_report(
                options.report,
                robot,
                logs,
                diagnosis,
                command=command_line(),
                discovery=discovery,
                commands=commands,
                simulated=simulated(),
            )
        console.print(f"wrote {path}")
    return int(diagnosis.verdict in ("unknown", "not_repeatable")), content


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
        Spoken(f"do this now: {what_to_do(diagnosis, commands)}"),
    ]
    parts = [Part("what is left", table(left_rows(diagnosis)))]
    if diagnosis.findings:
        parts.insert(0, Part("what was found", table(effect_rows(diagnosis))))
    for name, text in (
        ("what the rest looks like", diagnosis.remainder),
        ("warnings", "\n".join(diagnosis.warnings)),
    ):
        parts += [Part(name, Spoken(text))] if text else []
    if simulated:
        parts.append(Part("the open-loop error", lambda: open_loop_table(simulated())))
    if diagnosis.findings:
        parts.append(Part("how the error falls", table(step_rows(diagnosis))))
    if len(diagnosis.ranking) > 1:
        parts.append(Part("what else was tried", table(ranking_rows(diagnosis, verbose))))
    print_out(console, answer, parts, quiet=quiet, verbose=verbose)


def _print_discovery(console: Console, discovery: Discovery) -> None:
    """Print the proposals with what they remove, and how far to believe them."""
    console.print("discovery: formulas proposed by regression, not causes", style="bold")
    if discovery.proposals:
        console.print(table(formula_rows(discovery)))
    for proposal in discovery.proposals:
        console.print(proposal.formula)
        for name, rivals in proposal.rivals.items():
            if rivals:
                console.print(f"  instead of {name} as well: {', '.join(rivals)}")
        for warning in proposal.warnings:
            console.print(f"  warning: {warning}")
    for name, where in discovery.dropped:
        console.print(f"{name} at {where} is not needed beside the formulas")
    error = discovery.error
    console.print(f"held-out error: {error.before:.2f} -> {error.after:.2f} noise floors")
    console.print(discovery.summary)
    if discovery.proposals and discovery.remainder:
        console.print(discovery.remainder)
