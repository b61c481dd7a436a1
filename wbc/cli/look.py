"""`wbc look` and `play`: logs as pages, every column over time or the robot in motion."""

from __future__ import annotations

import tempfile
import webbrowser
from html import escape
from pathlib import Path

import numpy as np
from rich.console import Console

from wbc import view
from wbc.arrays import FloatArray, IntArray
from wbc.cli.inputs import read_logs
from wbc.cli.outputs import Options, Outcome, working
from wbc.effects import load_robot
from wbc.errors import ViewError
from wbc.files import write_text
from wbc.measurement.checks import plateau, resolution
from wbc.measurement.clocks import gaps, restarts
from wbc.measurement.column_map import read_table
from wbc.measurement.filters import jumps
from wbc.measurement.guess import guess_table
from wbc.measurement.names import guess_name
from wbc.measurement.schema import TIME
from wbc.measurement.tables import Table
from wbc.tables import few

_WIDTH, _HEIGHT, _BINS = 640, 54, 320
_FIRST = ("time", "position", "velocity", "motor_torque", "rotor_torque", "current", "target")
_LAST = ("no name that is known", "constant", "text")
_LEGEND = (
    "Blue: the range of the values in each slice of time. Orange: samples are missing. Red lines: "
    "the clock starts again. Red dots: jumps. Beside each: range, step, and what is odd about it."
)


def run_look(options: Options, console: Console) -> Outcome:
    """Draw the columns of files, and write the page."""
    known = read_table(options.columns)
    files = "".join(_file(guess_table(path, known)) for path in options.logs)
    style = (Path(view.__file__).parent / "page" / "look.css").read_text(encoding="utf-8")
    page = (
        "<!doctype html><meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
        f"<title>wbc look</title><style>{style}</style><p>{_LEGEND}</p>{files}"
    )
    console.print(f"wrote {write_text(Path(options.html), page)}", soft_wrap=True)
    return 0, {}


def _file(table: Table) -> str:
    """Return the part of the page about one file."""
    clock, time = _clock(table)
    steps, again = np.diff(time), restarts(time)
    holes = again[:0] if again.size else gaps(np.sort(time))
    shared = int(np.count_nonzero(steps == 0.0))
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else float("nan")
    said = [f"{table.rows} rows", f"clock: {clock}, usual step {usual:.6g}"]
    said += [f"{shared} rows share a stamp with the row before"] if shared else []
    said += [f"{again.size + 1} runs: the clock starts again"] if again.size else []
    said += [f"samples are missing in {holes.size} places"] if holes.size else []
    said += list(table.notes)
    # Rows in the order of the file: a clock that starts again would draw runs upon each other.
    place = time if not again.size and np.all(steps >= 0.0) else np.arange(table.rows, dtype=float)
    kinds = {name: _kind(table, name) for name in table.names}
    body, others = "", dict.fromkeys(k for k in kinds.values() if k not in _FIRST + _LAST)
    for kind in (*_FIRST, *others, *_LAST):
        names = [name for name, own in kinds.items() if own == kind]
        lines = "".join(_column(table, name, place, holes, again) for name in names)
        body += f"<h2>{escape(kind.replace('_', ' '))}</h2>{lines}" if names else ""
    return f"<h1>{escape(str(table.path))}</h1><p>{escape('; '.join(said))}</p>{body}"


def _clock(table: Table) -> tuple[str, FloatArray]:
    for name in table.clocks:
        if table.holds_numbers(name) and np.isfinite(table.numbers(name)).all():
            return f"'{name}'", table.numbers(name)
    return "none found, rows are counted", np.arange(table.rows, dtype=np.float64)


def _kind(table: Table, name: str) -> str:
    """Return the group of a column: what its name says, else what its values look like."""
    if not table.holds_numbers(name):
        return "text"
    quantity = guess_name(name).quantity or (TIME if name == TIME else "")
    if quantity.startswith(("target", "goal")):
        return "target"
    values = table.numbers(name)
    if np.nanmin(values, initial=np.inf) == np.nanmax(values, initial=-np.inf):
        return "constant"
    return quantity or "no name that is known"


def _column(table: Table, name: str, place: FloatArray, holes: IntArray, again: IntArray) -> str:
    """Return the row of the page about one column: its name, its picture, what is odd."""
    if not table.holds_numbers(name):
        kinds = list(dict.fromkeys(table.texts(name)))
        picture, said = "", [f"{len(kinds)} values: {', '.join(kinds[:4])}"]
    else:
        values = table.numbers(name)
        known = np.isfinite(values)
        picture, said = _picture(values, place, holes, again), _odd(values[known])
        if not known.all():
            said.append(f"{np.count_nonzero(~known)} empty cells")
    return (
        f"<div class='column'><b>{escape(name)}</b><div>{picture}</div>"
        f"<small>{escape('; '.join(said))}</small></div>"
    )


def _odd(values: FloatArray) -> list[str]:
    """Return what a column says of itself: range, step, plateaus, jumps, sign."""
    if not values.size:
        return ["empty"]
    low, high = float(values.min()), float(values.max())
    if low == high:
        return [f"{low:.5g} throughout"]
    said = [f"{low:.5g} to {high:.5g}"]
    step, rows, share = resolution(values), jumps(values)[0], plateau(values)[2]
    said += [f"steps of {step:.4g}"] if step else []
    said += [f"{rows.size} jumps"] if rows.size else []
    said += [f"{100.0 * share:.1f} % at an end"] if share > 0.005 else []
    said += ["never below zero"] if low == 0.0 else []
    return said


def _picture(values: FloatArray, place: FloatArray, holes: IntArray, again: IntArray) -> str:
    """Return the range of a column in each slice of time as SVG, with gaps, restarts and jumps."""
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return ""
    low, high = float(np.min(values[known])), float(np.max(values[known]))
    x = (place - place[0]) / max(float(place[-1] - place[0]), 1e-300) * _WIDTH
    y = _HEIGHT - 3.0 - (values - low) * ((_HEIGHT - 6.0) / max(high - low, 1e-300))
    bins = np.minimum((x[known] / _WIDTH * _BINS).astype(int), _BINS - 1)
    first = np.flatnonzero(np.diff(bins, prepend=-1))
    across = (bins[first] + 0.5) * _WIDTH / _BINS
    upper, lower = (way.reduceat(y[known], first) for way in (np.minimum, np.maximum))
    ring = [*zip(across, upper, strict=True), *zip(across[::-1], lower[::-1], strict=True)]
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in ring)
    marks = ""
    for left, right in zip(x[holes], x[holes + 1], strict=True):
        width = max(right - left, 1.5)
        marks += f"<rect class='gap' x='{left:.1f}' width='{width:.1f}' height='{_HEIGHT}'/>"
    for at in x[again]:
        marks += f"<line class='again' x1='{at:.1f}' x2='{at:.1f}' y2='{_HEIGHT}'/>"
    for row in np.flatnonzero(known)[jumps(values[known])[0]][:_BINS]:
        marks += f"<circle class='mark' cx='{x[row]:.1f}' cy='{y[row]:.1f}' r='2'/>"
    line = f"<polygon class='line' points='{points}'/>"
    return f"<svg viewBox='0 0 {_WIDTH} {_HEIGHT}'>{marks}{line}</svg>"


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
