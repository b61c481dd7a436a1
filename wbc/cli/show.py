"""`wbc play`: a recording in motion."""

from __future__ import annotations

import argparse
import tempfile
import webbrowser
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from wbc import view
from wbc.cli.inputs import read_logs
from wbc.cli.outputs import Outcome, working
from wbc.effects import load_robot
from wbc.errors import ViewError
from wbc.measurement import Log
from wbc.robot import Robot


def run_play(options: argparse.Namespace, console: Console) -> Outcome:
    """Write what was asked for; without any, open the page in the browser."""
    robot = load_robot(options.robot)
    log = _one_log(options, robot)
    for option, instant in (("at", options.at), ("from", options.start), ("to", options.stop)):
        if instant is not None and not log.time[0] <= instant <= log.time[-1]:
            raise ViewError(
                f"--{option} {instant:g} lies outside the log, which runs from {log.time[0]:g} s "
                f"to {log.time[-1]:g} s."
            )
    ghost = None
    if options.ghost:
        ghost = view.model_ghost(load_robot(options.ghost), log, label=Path(options.ghost).stem)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(options.html) if options.html else Path(folder) / "playback.html"
        with working(console, "drawing"):
            view.write_playback(page, robot, log, ghost=ghost, at=options.at)
        absent = [name for name in robot.single_joints if not log.has(f"{name}.position")]
        if absent:
            more = f" and {len(absent) - 4} more" if len(absent) > 4 else ""
            console.print(f"no position of {', '.join(absent[:4])}{more} in the log: shown at rest")
        written = [page] if options.html else []
        written += _pictures(options, page, log, console)
        for path in written:
            console.print(f"wrote {path}")
        if not written:
            if not webbrowser.open(page.resolve().as_uri()):
                raise ViewError("no browser to open the page in; write it with --html FILE.")
            console.input("Enter closes the page's file.")
    return 0, {}


def _one_log(options: argparse.Namespace, robot: Robot) -> Log:
    logs = read_logs([options.run_file], options.columns, robot)
    if len(logs) != 1:
        names = ", ".join(log.source.part for log in logs)
        raise ViewError(f"'{options.run_file}' holds several logs; choose one with #NAME: {names}.")
    return logs[0]


def _pictures(
    options: argparse.Namespace, page: Path, log: Log, console: Console
) -> Iterator[Path]:
    if options.png:
        at = float(log.time[0]) if options.at is None else options.at
        with working(console, "taking a picture"):
            yield view.write_picture(options.png, page, at, theme=options.theme)
    if options.gif:
        with working(console, "taking pictures") as progress:
            span = options.start, options.stop
            yield view.write_animation(
                options.gif,
                page,
                span,
                speed=options.speed,
                theme=options.theme,
                progress=progress,
            )
