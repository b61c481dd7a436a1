"""`wbc play`: a recording or log in motion."""

from __future__ import annotations

import argparse
import tempfile
import webbrowser
from pathlib import Path
from typing import Any

from rich.console import Console

from wbc.cli.inputs import read_logs
from wbc.effects import load_robot
from wbc.errors import ViewError


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "play",
        help="a recording in motion: one offline page, a picture, an animation",
        epilog="example: wbc play out/standing.parquet --robot planar_leg_strong --html run.html",
    )
    parser.add_argument("run_file", metavar="RUN", help="a recording or log")
    parser.add_argument("--robot", required=True, metavar="NAME", help="whose run it is")
    parser.add_argument("--columns", metavar="MAP.toml", help="foreign column names and units")
    parser.add_argument("--ghost", metavar="FITTED", help="a model to show beside the measurement")
    parser.add_argument("--html", metavar="FILE", help="write the page (default: open it)")
    parser.add_argument("--png", metavar="FILE", help="write a picture, with --at T")
    parser.add_argument("--at", type=float, default=0.0, metavar="T", help="time of it [s]")
    parser.add_argument("--gif", metavar="FILE", help="write an animation (.gif or .mp4)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Write what was asked for; without any, open the page in the browser."""
    from wbc.view import model_ghost, write_animation, write_picture, write_playback

    robot = load_robot(options.robot)
    logs = read_logs([options.run_file], options.columns, robot)
    if len(logs) != 1:
        names = ", ".join(log.source.part for log in logs)
        raise ViewError(f"'{options.run_file}' holds several logs; choose one with #NAME: {names}.")
    log = logs[0]
    ghost = None
    if options.ghost:
        model = load_robot(options.ghost)
        ghost = model_ghost(model, log, label=Path(options.ghost).stem)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(options.html) if options.html else Path(folder) / "playback.html"
        write_playback(page, robot, log, ghost=ghost)
        written = [page] if options.html else []
        if options.png:
            written.append(write_picture(options.png, page, options.at))
        if options.gif:
            written.append(write_animation(options.gif, page))
        for path in written:
            console.print(f"wrote {path}")
        if not written:
            if not webbrowser.open(page.resolve().as_uri()):
                raise ViewError("no browser to open the page in; write it with --html FILE.")
            console.input("Enter closes the page's file.")
    return 0
