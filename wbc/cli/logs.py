"""`wbc init`, `check` and `play`: what a log is good for, and how it looks; a first robot.toml."""

from __future__ import annotations

import re
import shlex
import tempfile
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from wbc import view
from wbc.cli.inputs import read_logs, robot_from, write_fix
from wbc.cli.outputs import Options, Outcome, Part, print_out, spoken, working
from wbc.effects import load_robot
from wbc.errors import ViewError, WbcError
from wbc.files import as_json
from wbc.identification.readings import LogQuality, check_logs, find_repeats, first_guess
from wbc.identification.readings.checks import clock_rows
from wbc.measurement import LogFinding, merged, read_table, write_map
from wbc.measurement.log import short_label
from wbc.robot.model_file import left_out
from wbc.tables import few

_NUMBER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?![\w])")


def run_check(options: Options, console: Console) -> Outcome:
    """Print the quality of every log; exit code 1 if one of them would give wrong results."""
    robot = robot_from(options)
    logs = read_logs(options.logs, options.columns, robot)
    qualities = check_logs(logs, robot)
    said = _remarks(qualities)
    # Of all that the loader notes, only this makes results wrong.
    impossible = [note for note in robot.notes if "that of no body" in note]
    said += [f"warning: {note} Correct its six numbers." for note in impossible]
    if guessed := ", ".join(first_guess.guessed_numbers(options.robot)):
        said.append(f"still guesses in {options.robot}, every answer rests on them: {guessed}")
    answer = [_answer(qualities, len(said), options.quiet)]
    parts: list[Part] = [("remarks", spoken(text, 2)) for text in said]
    for group in find_repeats(logs):
        names = ", ".join(short_label(qualities[k].label) for k in group)
        parts.append(("repeats", f"repeats of one run: {names}"))
    parts.append(("the clocks", clock_rows(qualities)))
    print_out(console, answer, [] if options.quiet else parts, options.verbose)
    wrong = {f.text: f for q in qualities for f in q.findings if f.severity == "error"}
    write_fix(options, list(wrong.values()), console)
    content = {"logs": {quality.label: as_json(quality) for quality in qualities}}
    return int(bool(wrong)), content


def _remarks(qualities: Sequence[LogQuality]) -> list[str]:
    """Return every remark once, with the logs and columns that it is about."""
    alike: dict[tuple[str, ...], list[tuple[str, LogFinding]]] = {}
    for quality in qualities:
        for finding in quality.findings:
            said = (finding.text, finding.way_out)
            blank = [_NUMBER.sub("#", text.replace(finding.column or "*", "*")) for text in said]
            key = (finding.severity, finding.kind, *blank)
            alike.setdefault(key, []).append((short_label(quality.label), finding))
    return [_joined(group, len(qualities)) for group in alike.values()]


def _joined(group: Sequence[tuple[str, LogFinding]], logs: int) -> str:
    """Return one remark of findings that differ in logs, columns and numbers alone."""
    where = list(dict.fromkeys(label for label, _ in group))
    first, texts = group[0][1], [finding.text for _, finding in group]
    columns = list(dict.fromkeys(finding.column for _, finding in group))
    ways = []
    for line in first.way_out.splitlines():
        named = first.column and first.column in line
        ways += [line.replace(first.column, column) for column in columns] if named else [line]
    # Its numbers run from the least to the most of those in all texts.
    numbers = zip(*map(_NUMBER.findall, texts), strict=True)
    each = (sorted(dict.fromkeys(found), key=float) for found in numbers)
    ranges = (own[0] if len(own) == 1 else f"{own[0]}…{own[-1]}" for own in each)
    text = _NUMBER.sub(lambda _: next(ranges), texts[0])
    said = replace(first, column=", ".join(columns), text=text, way_out="\n".join(ways))
    place = f"all {logs} logs" if len(where) == logs else ", ".join(where)
    return str(said) if logs == 1 else f"{place}: {said}"


def _answer(qualities: Sequence[LogQuality], remarks: int, quiet: bool) -> str:
    """Return in a sentence whether the logs can be used."""
    if wrong := ", ".join(short_label(one.label) for one in qualities if not one.usable):
        why = " Why: the same command without --quiet." if quiet else ""
        return f"do not use yet: {wrong} would give wrong results.{why}"
    many = "one remark" if remarks == 1 else f"{remarks} remarks"
    told = f"{many} (printed without --quiet)" if quiet else "the remarks below"
    return f"these logs can be used, with {told}." if remarks else "nothing to complain about"


def run_init(options: Options, console: Console) -> Outcome:
    """Guess, write, and say what to do next."""
    folder, model = Path(options.folder), Path(options.robot)
    described = model.suffix not in (".urdf", ".xml")
    description, columns = folder / "robot.toml", folder / "columns.toml"
    if described and not options.logs:
        raise WbcError(f"'{model}' is described already: give logs, or a URDF or MJCF file.")
    for target, made in ((columns, options.logs), (description, not described)):
        if made and target.exists():
            raise WbcError(f"'{target}' is there already; choose another folder with --out.")
    if options.rate is not None and not options.rate > 0.0:
        raise WbcError("--rate must be > 0.")
    say, known = partial(console.print, soft_wrap=True), read_table(options.columns)
    known = known if options.rate is None else merged(known, {"time": {"rate": options.rate}})
    robot = load_robot(options.robot) if described else None
    joints = first_guess.model_joints(model, options.base) if robot is None else robot.single_joints
    if not options.logs:
        _describe(options, description, joints, say, shared=True)
        apart = f"a joint with another gear gets its own, for example [gears.{joints[0]}]"
        say(f"{len(joints)} gears share one table; {apart}")
        say(f'next: wbc.load_robot("{description}") for wbc.control and wbc.sim')
        return 0, {}
    first = Path(str(options.logs[0]).partition("#")[0])
    start = first_guess.guess_names(first, joints, known)
    if robot is None:
        driven, targets, held = _drives(start, joints, say)
        ratios = start.ratios
        _describe(options, description, driven, say, targets=targets, held=held, ratios=ratios)
        if held:
            locked = "holds them at zero; if they moved, record their positions"
            say(f"no column with the position of {', '.join(held)}: lock in {description} {locked}")
        robot = load_robot(description)
    try:
        guess = first_guess.guess_map(robot, options.logs, start)
    except BaseException:  # a log that cannot be read leaves no half of the answer
        if not described:
            description.unlink()
        raise
    reasons = [f"guess: {reason}" for reason in guess.reasons]
    write_map(columns, guess.table, ["Written by `wbc init`; every line is a guess.", *reasons])
    for reason in reasons:
        say(f"  {reason}")
    for joint, (own, share) in guess.told.items():
        told = f"with {100.0 * own:.0f} %, and explain {100.0 * share:.0f} % of its torque"
        say(f"  {joint}: motion and torque alone tell its columns {told}")
    console.print(f"wrote {columns}")
    for finding in guess.lacking:
        console.print(spoken(f"not found: {finding.said}"))
    name = options.robot if described else str(description)
    check = ["wbc", "check", *options.logs, "--robot", name, "--columns", str(columns)]
    say(f"next: {shlex.join(check)}")
    return 0, {}


def _drives(
    start: first_guess.MapGuess, joints: Sequence[str], say: Callable[[str], None]
) -> tuple[Sequence[str], Sequence[str], list[str]]:
    """Return the joints with a drive, those driven by targets, and those that nobody recorded."""
    # Where other drives report a torque, a joint with a target alone has no drive.
    targets = () if start.driven else start.targets
    driven = start.driven or targets or tuple(j for j in joints if j not in start.unseen)
    if start.driven and start.targets:
        lacks = f"targets and no torque of {', '.join(start.targets)}"
        why = "taken for a joint without a drive, which gets no gear"
        way = f"if it has one, add [gears.{start.targets[0]}] with kp and kd"
        say(f"{lacks}, while other drives report theirs: {why}; {way}")
    elif targets:
        say("no torque but targets: replace the guessed drive gains kp and kd in robot.toml")
    elif not start.driven:
        say("no column looks like a torque or current: every joint gets a gear")
    return driven, targets, [joint for joint in start.unseen if joint not in driven]


def _describe(
    options: Options, target: Path, driven: Sequence[str], say: Callable[[str], None], **more: Any
) -> None:
    """Write the robot.toml; name it, what of the model file it leaves out, and its guesses."""
    model = Path(options.robot)
    first_guess.write_robot(target, model, options.base, driven, **more)
    say(f"wrote {target}")
    for note in left_out(model):
        say(f"note: {note}")
    if guessed := first_guess.guessed_numbers(target):
        say(f"look up in {target}: {', '.join(guessed)}")


def run_play(options: Options, console: Console) -> Outcome:
    """Write the page, or open it in the browser."""
    robot = load_robot(options.robot)
    logs = read_logs([options.run_file], options.columns, robot)
    if len(logs) != 1:
        names = ", ".join(log.source.part for log in logs)
        raise ViewError(f"'{options.run_file}' holds several logs; choose one with #NAME: {names}.")
    (log,) = logs
    ghost = None
    if options.ghost:
        ghost = view.model_ghost(load_robot(options.ghost), log, label=Path(options.ghost).stem)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(options.html) if options.html else Path(folder) / "playback.html"
        with working(console, "drawing"):
            view.write_playback(page, robot, log, ghost=ghost)
        absent = [name for name in robot.single_joints if not log.has(f"{name}.position")]
        if absent:
            console.print(f"no position of {few(absent, 4)} in the log: shown at rest")
        if options.html:
            console.print(f"wrote {page}")
        elif webbrowser.open(page.resolve().as_uri()):
            console.input("Enter closes the page's file.")
        else:
            raise ViewError("no browser to open the page in; write it with --html FILE.")
    return 0, {}
