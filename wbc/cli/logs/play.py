"""`wbc play`: a recording or log in motion."""

from __future__ import annotations

import argparse
import tempfile
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from wbc.cli.shared.inputs import read_logs, working
from wbc.cli.shared.outputs import require_outputs
from wbc.effects import load_robot
from wbc.errors import ViewError
from wbc.measurement import Log
from wbc.robot import Robot

if TYPE_CHECKING:
    from wbc.view import Ghost, GroundSlab

_GROUND_WIDTH = 2.0

_EPILOG = """examples:
  wbc play out/landing.parquet --robot planar_leg_strong --html a.html
  wbc play run.csv --robot planar_leg --ghost fitted.toml --png a.png --at 0.3
  wbc play run.csv --robot planar_leg --gif a.mp4 --from 0.3 --to 1 --speed 0.1

Pictures need Chromium, .mp4 needs ffmpeg. Without --html, --png, --gif
the page opens in the browser."""


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "play",
        help="a recording in motion: one offline page, a picture, an animation",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("run_file", metavar="RUN", help="a recording or log")
    parser.add_argument("--robot", required=True, metavar="NAME", help="the robot of the recording")
    parser.add_argument("--columns", metavar="MAP.toml", help="foreign column names and units")
    parser.add_argument("--ghost", metavar="FITTED", help="a model to show beside the measurement")
    parser.add_argument(
        "--ground",
        metavar="X,Z ...",
        help="slopes and steps: their profile [m], x rising",
    )
    parser.add_argument("--html", metavar="FILE", help="write the page")
    parser.add_argument("--png", metavar="FILE", help="write a picture, taken at --at")
    parser.add_argument(
        "--at", type=float, metavar="T", help="time [s] of the picture, where the page waits"
    )
    parser.add_argument("--gif", metavar="FILE", help="write an animation (.gif or .mp4)")
    parser.add_argument(
        "--from", dest="start", type=float, metavar="T", help="start of the animation [s]"
    )
    parser.add_argument(
        "--to", dest="stop", type=float, metavar="T", help="end of the animation [s]"
    )
    parser.add_argument(
        "--speed", type=float, default=1.0, metavar="X", help="0.1 shows it ten times slower"
    )
    parser.add_argument(
        "--theme",
        choices=("light", "dark"),
        default="light",
        help="colours of pictures (default light)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Write what was asked for; without any, open the page in the browser."""
    from wbc.view import write_playback

    require_outputs(options)
    robot = load_robot(options.robot)
    log = _one_log(options, robot)
    for option, instant in (("at", options.at), ("from", options.start), ("to", options.stop)):
        _require_inside(option, instant, log)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(options.html) if options.html else Path(folder) / "playback.html"
        with working(console, "drawing"):
            write_playback(
                page, robot, log, ghost=_ghost(options, log), ground=_ground(options), at=options.at
            )
        _tell_absent(robot, log, console)
        written = [page] if options.html else []
        written += _pictures(options, page, log, console)
        for path in written:
            console.print(f"wrote {path}")
        if not written:
            _open(page, console)
    return 0


def _one_log(options: argparse.Namespace, robot: Robot) -> Log:
    logs = read_logs([options.run_file], options.columns, robot)
    if len(logs) != 1:
        names = ", ".join(log.source.part for log in logs)
        raise ViewError(f"'{options.run_file}' holds several logs; choose one with #NAME: {names}.")
    return logs[0]


def _tell_absent(robot: Robot, log: Log, console: Console) -> None:
    absent = [name for name in robot.single_joints if not log.has(f"{name}.position")]
    if absent:
        more = f" and {len(absent) - 4} more" if len(absent) > 4 else ""
        console.print(f"no position of {', '.join(absent[:4])}{more} in the log: shown at rest")


def _require_inside(option: str, instant: float | None, log: Log) -> None:
    if instant is not None and not log.time[0] <= instant <= log.time[-1]:
        raise ViewError(
            f"--{option} {instant:g} lies outside the log, which runs from {log.time[0]:g} s "
            f"to {log.time[-1]:g} s."
        )


def _ghost(options: argparse.Namespace, log: Log) -> Ghost | None:
    from wbc.view import model_ghost

    if not options.ghost:
        return None
    return model_ghost(load_robot(options.ghost), log, label=Path(options.ghost).stem)


def _ground(options: argparse.Namespace) -> tuple[GroundSlab, ...] | None:
    from wbc.view import profile_ground

    if options.ground is None:
        return None
    try:
        points = [(float(x), float(z)) for x, z in map(_pair, options.ground.split())]
    except ValueError as cause:
        raise ViewError(
            f"--ground '{options.ground}' is not a profile X,Z X,Z ...; for a step of 10 cm: "
            '--ground "-1,0 0,0 0,0.1 1,0.1".'
        ) from cause
    return profile_ground(points, _GROUND_WIDTH)


def _pair(text: str) -> list[str]:
    return text.split(",")


def _pictures(
    options: argparse.Namespace, page: Path, log: Log, console: Console
) -> Iterator[Path]:
    from wbc.view import write_animation, write_picture

    if options.png:
        at = float(log.time[0]) if options.at is None else options.at
        with working(console, "taking a picture"):
            yield write_picture(options.png, page, at, theme=options.theme)
    if options.gif:
        with working(console, "taking pictures") as progress:
            yield write_animation(
                options.gif,
                page,
                start=options.start,
                stop=options.stop,
                speed=options.speed,
                theme=options.theme,
                progress=progress,
            )


def _open(page: Path, console: Console) -> None:
    if not webbrowser.open(page.resolve().as_uri()):
        raise ViewError("no browser to open the page in; write it with --html FILE.")
    console.input("Enter closes the page's file.")
