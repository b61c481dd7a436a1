"""`wbc play`: a recording in motion, as one offline page."""

from __future__ import annotations

import tempfile
import webbrowser
from pathlib import Path

from rich.console import Console

from wbc import view
from wbc.cli.inputs import read_logs
from wbc.cli.outputs import Options, Outcome, working
from wbc.effects import load_robot
from wbc.errors import ViewError
from wbc.tables import few


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
