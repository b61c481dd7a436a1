"""`wbc compare`, `diagnose`, `identify`, `rollout`, `trend`: a robot held against its logs."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from math import inf
from typing import Any

import tomli_w
from rich.console import Console, RenderableType
from rich.text import Text

from wbc.cli import outputs
from wbc.cli.inputs import robot_and_logs, robot_from
from wbc.cli.outputs import Options, Outcome, Part, command_line, print_out, spoken, working
from wbc.effects import effect_class, save_robot
from wbc.errors import WbcError
from wbc.files import write_text
from wbc.identification import Diagnosis, compare, diagnose
from wbc.identification.answer.words import Commands, verdict_sentence, what_to_do
from wbc.identification.choice.find_causes import INTERRUPTED
from wbc.identification.classic import identify
from wbc.identification.formulas import Discovery, discover
from wbc.identification.open_loop import OpenLoop, open_loop, open_loop_rows
from wbc.identification.readings.first_guess import guessed_numbers
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.tables import TextTable

Simulated = Callable[[], Sequence[OpenLoop]]
"""Returns the open-loop errors of robots, simulating when it is first called."""
_Intervals = Mapping[tuple[str, str, str], tuple[float, float]]
_LEGEND = (
    "m is a mass, mx a mass times its centre, Ixx an inertia about the joint's origin. 'with': the "
    "logs tell only the sum of the number and this. What is left is the rms [N m] on parts of the "
    "logs that the fit did not see."
)


def run_compare(options: Options, console: Console) -> Outcome:
    """Compare, print, write."""
    robot, logs = robot_and_logs(options)
    with working(console, "comparing"):
        comparison = compare(robot, logs)
    simulated = simulated_later((robot,), logs, console)
    parts: list[Part] = [
        ("the error of every output", comparison.error_rows()),
        ("the open-loop error", lambda: open_loop_shown(simulated())),
        ("warnings", "\n".join(comparison.warnings)),
        ("where it fails", comparison.where_rows()),
    ]
    print_out(console, [comparison.sentence], [] if options.quiet else parts, options.verbose)
    content = comparison.to_json(command_line())
    if options.json:
        content["open_loop"] = simulated()[0].to_json()
    if options.report:
        _write_report(options, console, robot, logs, simulated=simulated())
    return 0, content


def _write_report(
    options: Options, console: Console, robot: Robot, logs: Sequence[Log], **found: Any
) -> None:
    """Write the report."""
    # Plotly, matplotlib and meshcat take a second to import; only a report needs them.
    from wbc.view.report import write_report

    with working(console, "writing the report"):
        path = write_report(options.report, robot, logs, command=command_line(), **found)
    console.print(f"wrote {path}")


def simulated_later(
    robots: Sequence[Robot], logs: Sequence[Log], console: Console, until: float = inf
) -> Simulated:
    """Return a function that simulates the logs once, when their errors are first wanted.

    The first simulation after the installation waits about a minute for the compiler. The answer of
    a command does not need it, so it is printed before.

    Args:
        robots: each is simulated.
        logs: along which.
        console: where the work is shown.
        until: time [s] of the monotonic clock at which they must end.
    """

    @cache
    def simulated() -> Sequence[OpenLoop]:
        what = "simulating the logs (the first time, the simulator is compiled: about a minute)"
        with working(console, what):
            return tuple(open_loop(robot, logs, until=until) for robot in robots)

    return simulated


def open_loop_shown(simulated: Sequence[OpenLoop]) -> TextTable | str:
    """Return position errors after each horizon, or why there are none."""
    reason = simulated[-1].reason
    return f"open loop: nothing was simulated: {reason}" if reason else open_loop_rows(simulated)


def run_diagnose(options: Options, console: Console) -> Outcome:
    """Diagnose, print, write; exit code 1 when the cause stays unknown or runs do not repeat."""
    if not options.budget > 0.0:
        raise WbcError(f"--budget {options.budget:g}: give a time > 0 [s].")
    until = time.monotonic() + options.budget
    names = () if options.add == "auto" else options.add.split(",")
    candidates = [effect_class(name.strip()) for name in names] or None
    robot, logs = robot_and_logs(options)
    if guessed := ", ".join(guessed_numbers(options.robot)):
        why = "Wrong gears look like many causes: the search may take long."
        known = f"{guessed} in {options.robot} are still guesses of `wbc init`."
        console.print(f"{known} {why}", soft_wrap=True)
    with working(console, "diagnosing") as progress:
        diagnosis = diagnose(robot, logs, candidates, progress, until - time.monotonic())
    if options.save:
        # Before the logs are simulated, which takes a minute the first time: nobody loses it then.
        _save(options.save, diagnosis.robot, diagnosis.intervals(), logs)
    if diagnosis.stopped == INTERRUPTED:
        until = 0.0  # nobody who stopped the search waits for a simulation
    robots = (robot, diagnosis.robot) if diagnosis.findings else (robot,)
    simulated = simulated_later(robots, logs, console, until)
    given = {name: getattr(options, name) for name in ("lossless", "columns", "add")}
    commands = Commands(options.logs, options.robot, saved=options.save, **given)
    print_diagnosis(console, diagnosis, commands, simulated, options.quiet, options.verbose)
    content, discovery = diagnosis.to_json(command_line()), None
    if options.discover:
        with working(console, "discovering") as progress:
            discovery = discover(robot, logs, progress, diagnosis.effects)
        _print_discovery(console, discovery)
        content["discovery"] = discovery.to_json()
        if options.save and discovery.proposals:
            _save(options.save, discovery.robot, discovery.intervals, logs)
    if options.save:
        something = diagnosis.effects or (discovery is not None and discovery.proposals)
        as_it_was = "" if something else ": the robot as given, no effect was added"
        console.print(f"wrote {options.save}{as_it_was}", soft_wrap=True)
    if options.json:
        before, *after = (one.to_json() for one in simulated())
        content["open_loop"] = {"before": before, "after": after[0] if after else before}
    if options.report:
        told = {"diagnosis": diagnosis, "discovery": discovery, "commands": commands}
        _write_report(options, console, robot, logs, simulated=simulated(), **told)
    return int(diagnosis.verdict in ("unknown", "not_repeatable")), content


def _save(path: str, robot: Robot, intervals: _Intervals, logs: Sequence[Log]) -> None:
    """Write a robot with the effects found, and what they come from."""
    names = ", ".join(f"{log.source.label} {log.source.sha256[:16]}" for log in logs)
    save_robot(robot, path, intervals, {"logs": names, "command": command_line()})


def print_diagnosis(
    console: Console,
    diagnosis: Diagnosis,
    commands: Commands | None = None,
    simulated: Simulated | None = None,
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
        Text(diagnosis.headline, style="bold"),
        verdict_sentence(diagnosis),
        spoken(f"do this now: {what_to_do(diagnosis, commands)}"),
    ]
    parts: list[Part] = [
        ("what was found", diagnosis.effect_rows()),
        ("what is left", diagnosis.left_rows()),
        ("what the rest looks like", diagnosis.remainder),
        ("warnings", "\n".join(diagnosis.warnings)),
    ]
    if simulated:
        parts.append(("the open-loop error", lambda: open_loop_shown(simulated())))
    if diagnosis.findings:
        parts.append(("how the error falls", diagnosis.step_rows()))
    parts.append(("what else was tried", diagnosis.ranking_rows(verbose)))
    print_out(console, answer, [] if quiet else parts, verbose)


def _print_discovery(console: Console, discovery: Discovery) -> None:
    """Print the proposals with what they remove, and how far to believe them."""
    console.print("discovery: formulas proposed by regression, not causes", style="bold")
    if discovery.proposals:
        console.print(discovery.rows())
    lines, error = [], discovery.error
    for proposal in discovery.proposals:
        others = {name: ", ".join(rivals) for name, rivals in proposal.rivals.items() if rivals}
        lines.append(proposal.formula)
        lines += [f"  instead of {name} as well: {rivals}" for name, rivals in others.items()]
        lines += [f"  warning: {warning}" for warning in proposal.warnings]
    lines += [f"{name} at {at} is not needed beside the formulas" for name, at in discovery.dropped]
    lines.append(f"held-out error: {error.before:.2f} -> {error.after:.2f} noise floors")
    lines.append(discovery.summary)
    lines += [discovery.remainder] if discovery.proposals and discovery.remainder else []
    console.print("\n".join(lines))


def run_identify(options: Options, console: Console) -> Outcome:
    """Fit, print, write."""
    robot, logs = robot_and_logs(options)
    with working(console, "identifying"):
        fit = identify(robot, logs)
    parameters, left = fit.rows()
    console.print(parameters, _LEGEND, left, sep="\n")
    for warning in fit.warnings:
        console.print(spoken(warning), crop=False)
    return 0, fit.to_json()


def run_rollout(options: Options, console: Console) -> Outcome:
    """Fit, print, write."""
    # To load the rollouts takes a fifth of a second, which no other command waits for.
    from wbc.identification.servo import MOTOR, UNITS, fit_rollouts

    robot, logs = robot_and_logs(options)
    with working(console, "simulating") as progress:
        found = fit_rollouts(robot, logs, progress)
    for rows in found.rows():
        console.print(rows)
    if options.save:
        effects, gears = found.chosen.fit.robot.effects, found.chosen.fit.robot.transmission
        shown = robot.without_effects().with_effects(*effects)
        path = save_robot(shown, options.save, provenance={"command": command_line()})
        own = {n: {"value": float(getattr(gears, n)[0]), "unit": UNITS[n]} for n in MOTOR}
        stated = tomllib.loads(path.read_text(encoding="utf-8")) | {"gears": {gears.joints[0]: own}}
        console.print(f"wrote {write_text(path, tomli_w.dumps(stated))}", soft_wrap=True)
    return 0, found.to_json()


def run_trend(options: Options, console: Console) -> Outcome:
    """Measure every session, print what drifts, draw, write; exit code 4 if it is asked for."""
    from wbc.identification.trend import find_sessions, follow

    robot, sessions = robot_from(options), find_sessions(options.logs)
    with outputs.watching("sessions", console) as watch:
        trend = follow(robot, sessions, options.columns, options.workers, watch)
    failed = [f"{s.machine} {s.date}: {s.failure}" for s in trend.sessions if s.failure]
    parts: list[Part] = [
        ("what drifts", trend.rows(True)),
        ("what was not measured", "\n".join(f"not measured: {one}" for one in failed)),
        ("what does not surely drift", trend.rows(False)),
    ]
    print_out(console, [trend.sentence], [] if options.quiet else parts, options.verbose)
    if options.figures:
        from wbc.view.plots import trend_figure

        outputs.write_figures(options, {"trend": partial(trend_figure, trend)}, console)
    return 4 if options.fail_on_drift and trend.drifting else 0, trend.to_json()
