"""`wbc init`: from a model and logs that nobody has described to a first robot.toml and map."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from rich.console import Console

from wbc.cli.outputs import Outcome
from wbc.cli.printout import Spoken
from wbc.effects import load_robot
from wbc.errors import WbcError
from wbc.measurement import read_table, write_map
from wbc.measurement.guess import (
    guess_map,
    guess_names,
    guess_ratios,
    guessed_numbers,
    model_joints,
    not_found,
    write_robot,
)
from wbc.robot.loading.model_file import left_out


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Guess, write, and say what to do next."""
    folder = Path(options.folder)
    model = Path(options.robot)
    described = model.suffix not in (".urdf", ".xml")
    files = [folder / "columns.toml"] if options.logs else []
    files += [] if described else [folder / "robot.toml"]
    if not files:
        raise WbcError(f"'{model}' is described already: give logs, or a URDF or MJCF file.")
    for target in files:
        if target.exists():
            raise WbcError(f"'{target}' is there already; choose another folder with --out.")
    if options.rate is not None and not options.rate > 0.0:
        raise WbcError("--rate must be > 0.")
    if not options.logs:
        return _without_logs(model, options.base, files[0], console)
    known = read_table(options.columns)
    given = [Path(str(path).partition("#")[0]) for path in options.logs]
    if described:
        name, robot = options.robot, load_robot(options.robot)
        start = guess_names(given[0], robot.single_joints, options.rate, known)
    else:
        joints = model_joints(model, options.base)
        start = guess_names(given[0], joints, options.rate, known)
        # Where other drives report a torque, a joint with a target alone has no drive.
        targets = () if start.driven else start.targets
        driven = start.driven or targets or tuple(j for j in joints if j not in start.unseen)
        if start.driven and start.targets:
            console.print(
                f"targets and no torque of {', '.join(start.targets)}, while other drives report "
                "theirs: taken for a joint without a drive, which gets no gear; if it has one, add "
                f"[gears.{start.targets[0]}] with kp and kd",
                soft_wrap=True,
            )
        elif targets:
            console.print(
                "no torque but targets: replace the guessed drive gains kp and kd in robot.toml"
            )
        elif not start.driven:
            console.print("no column looks like a torque or current: every joint gets a gear")
        held = [joint for joint in start.unseen if joint not in driven]
        title, target = model.resolve().stem, folder / "robot.toml"
        ratios = guess_ratios(given[0], driven, known)
        name = str(write_robot(target, model, options.base, driven, title, targets, held, ratios))
        _say_written(name, model, console)
        if held:
            console.print(
                f"no column with the position of {', '.join(held)}: lock in {name} holds them at "
                "zero; if they moved, record their positions",
                soft_wrap=True,
            )
        robot = load_robot(name)
    guess = guess_map(robot, options.logs, start)
    reasons = [f"guess: {reason}" for reason in guess.reasons]
    path = write_map(
        files[0], guess.table, ["Written by `wbc init`; every line is a guess.", *reasons]
    )
    for reason in reasons:
        console.print(f"  {reason}", soft_wrap=True)
    for joint, (own, share) in guess.told.items():
        console.print(
            f"  {joint}: motion and torque alone tell its columns with {100.0 * own:.0f} %, and "
            f"explain {100.0 * share:.0f} % of its torque",
            soft_wrap=True,
        )
    console.print(f"wrote {path}")
    for finding in not_found(robot, options.logs, guess.table):
        console.print(Spoken(f"not found: {finding.text} {finding.way_out}"))
    logs = shlex.join(options.logs)
    console.print(f"next: wbc check {logs} --robot {name} --columns {path}", soft_wrap=True)
    return 0, {}


def _without_logs(model: Path, base: str, target: Path, console: Console) -> Outcome:
    """Describe a model whose gears are all alike, as far as nobody says more."""
    joints = model_joints(model, base)
    title = model.resolve().stem
    name = str(write_robot(target, model, base, joints, title, shared=True))
    _say_written(name, model, console)
    console.print(
        f"{len(joints)} gears share one table; a joint with another gear gets "
        f"its own, for example [gears.{joints[0]}]",
        soft_wrap=True,
    )
    console.print(f'next: wbc.load_robot("{name}") for wbc.control and wbc.sim', soft_wrap=True)
    return 0, {}


def _say_written(name: str, model: Path, console: Console) -> None:
    """Name the robot.toml, what of the model file it leaves out, and its guesses."""
    console.print(f"wrote {name}")
    for note in left_out(model):
        console.print(f"note: {note}", soft_wrap=True)
    if guessed := guessed_numbers(name):
        console.print(f"look up in {name}: {', '.join(guessed)}", soft_wrap=True)
