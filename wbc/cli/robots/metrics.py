"""`wbc metrics`: what the gears do to inertia, force capability and impacts at a contact."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc.arrays import FloatArray
from wbc.cli.shared.inputs import table_console, write_json
from wbc.cli.shared.outputs import require_outputs
from wbc.cli.shared.sites import checked_axes, first_contact, pose_from
from wbc.effects import load_robot
from wbc.errors import ViewError
from wbc.metrics import Metric, summary, with_contact_at
from wbc.robot import Robot


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "metrics",
        help="inertia, force capability, impacts and holding of a contact",
        epilog="example: wbc metrics planar_leg --pose hip=-0.5236,knee=1.0472 --figures out",
    )
    parser.add_argument("robot", metavar="ROBOT", help="shipped robot, robot.toml or fitted.toml")
    parser.add_argument("--contact", metavar="NAME", help="or a frame; default: the first contact")
    parser.add_argument(
        "--pose", metavar="NAME|J=V,...", help="a named pose or joint positions [rad, m]"
    )
    parser.add_argument("--axes", default="xz", help="world axes (default xz)")
    parser.add_argument(
        "--load", type=float, metavar="N", help="force to hold [N]; default: the robot's weight"
    )
    parser.add_argument(
        "--figures", nargs="?", const="out", metavar="DIR", help="write the two figures (PNG)"
    )
    parser.add_argument(
        "--theme", choices=("light", "dark"), default="light", help="colours of the figures"
    )
    parser.add_argument("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Print the metrics, write figures and JSON."""
    require_outputs(options)
    if options.figures and len(options.axes) != 2:
        raise ViewError(f"--figures are drawn in two axes, not in '{options.axes}'.")
    robot = load_robot(options.robot)
    contact = options.contact or first_contact(robot)
    robot = with_contact_at(robot, contact)
    position = pose_from(robot, options.pose)
    metrics = summary(robot, position, contact, checked_axes(options.axes), options.load)
    shown = table_console(options, console)
    _print(metrics, f"{robot.name}, contact {contact}", shown)
    write_json(options.json, _json(metrics), console)
    if options.figures:
        _draw(robot, position, contact, options, shown)
    return 0


def _json(metrics: list[Metric]) -> dict[str, Any]:
    """Return name with unit -> value, and the assumption of each under "assumptions"."""
    found: dict[str, Any] = {_label(metric): _by_joint(metric) for metric in metrics}
    found["assumptions"] = {_label(metric): metric.assumption for metric in metrics}
    return found


def _by_joint(metric: Metric) -> Any:
    """Return the value, of a vector with an entry per gear the one of each joint."""
    plain = _plain(metric.value)
    return dict(zip(metric.joints, plain, strict=True)) if metric.joints else plain


def _label(metric: Metric) -> str:
    return metric.name if metric.unit == "1" else f"{metric.name} [{metric.unit}]"


def _plain(value: Any) -> Any:
    """Return a value that JSON can hold: infinite is "unlimited", unknown is None."""
    if isinstance(value, np.ndarray):
        return [_plain(entry) for entry in value.tolist()]
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else "unlimited"
    return value


def _print(metrics: list[Metric], title: str, console: Console) -> None:
    """Print the table, and below it what each number assumes."""
    notes = list(dict.fromkeys(metric.assumption for metric in metrics))
    table = Table("metric", "value", "assumes", box=None, title=title)
    for metric in metrics:
        table.add_row(_label(metric), _text(metric), str(notes.index(metric.assumption) + 1))
    console.print(table)
    assumed = Table("", "what the numbers assume", box=None)
    for number, note in enumerate(notes, 1):
        assumed.add_row(str(number), note)
    console.print(assumed)


def _text(metric: Metric) -> str:
    plain = _by_joint(metric)
    if isinstance(plain, dict):
        return "\n".join(f"{_entry(value)}  {joint}" for joint, value in plain.items())
    if isinstance(plain, str):
        return plain
    if plain is None:
        return "unknown (no torque_constant or resistance)"
    if isinstance(plain, list):
        rows = plain if plain and isinstance(plain[0], list) else [plain]
        return "\n".join("  ".join(_entry(x) for x in row) for row in rows)
    return f"{plain:.6g}"


def _entry(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:9.4f}"


def _draw(
    robot: Robot, q: FloatArray, contact: str, options: argparse.Namespace, console: Console
) -> None:
    from wbc.view import DARK, LIGHT
    from wbc.view.plots import leg_figure, tradeoff_figure, write_figure

    theme, axes = (DARK if options.theme == "dark" else LIGHT), options.axes
    for name, figure in (
        ("leg", leg_figure(robot, q, contact, theme, axes)),
        ("tradeoff", tradeoff_figure(robot, q, contact, theme=theme, axes=axes)),
    ):
        path = write_figure(Path(options.figures) / f"{robot.name}_{name}.png", figure)
        console.print(f"wrote {path}")
