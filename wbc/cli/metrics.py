"""`wbc metrics`: what the gears do to inertia, force capability and impacts at a contact."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc.arrays import FloatArray
from wbc.cli.inputs import table_console, write_json
from wbc.cli.outputs import require_outputs
from wbc.effects import load_robot
from wbc.errors import DynamicsError, RobotError, ViewError, WbcError
from wbc.metrics import (
    backward_generalized_inertia,
    force_capability,
    forward_generalized_inertia,
    generalized_inertia,
    impact_mitigation,
)
from wbc.robot import Robot


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "metrics",
        help="inertia, force capability and impact mitigation of a contact",
        epilog="example: wbc metrics planar_leg --pose hip=-0.5236,knee=1.0472 --figures out",
    )
    parser.add_argument("robot", metavar="ROBOT", help="shipped robot, robot.toml or fitted.toml")
    parser.add_argument("--contact", metavar="NAME", help="default: the first one")
    parser.add_argument(
        "--pose", metavar="NAME|J=V,...", help="a named pose or joint positions [rad, m]"
    )
    parser.add_argument("--axes", default="xz", help="world axes (default xz)")
    parser.add_argument(
        "--figures", nargs="?", const="out", metavar="DIR", help="write the two figures (PNG)"
    )
    parser.add_argument(
        "--theme", choices=("light", "dark"), default="light", help="of the figures"
    )
    parser.add_argument("--json", metavar="FILE", help="the same for machines ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Print the metrics, write figures and JSON."""
    require_outputs(options)
    if options.figures and len(options.axes) != 2:
        raise ViewError(f"--figures are drawn in two axes, not in '{options.axes}'.")
    robot = load_robot(options.robot)
    contact = options.contact or _first_contact(robot)
    position = _pose(robot, options.pose)
    figures = _figures(robot, position, contact, options.axes)
    shown = table_console(options, console)
    table = Table("metric", "value", box=None, title=f"{robot.name}, contact {contact}")
    for name, value in figures.items():
        table.add_row(name, _text(value))
    shown.print(table)
    write_json(options.json, figures, console)
    if options.figures:
        _draw(robot, position, contact, options, shown)
    return 0


def _first_contact(robot: Robot) -> str:
    if not robot.contacts:
        raise RobotError(f"'{robot.name}' has no contact; add [[contacts]] to its description.")
    return robot.contacts[0].name


def _pose(robot: Robot, text: str | None) -> FloatArray:
    if text is None or "=" not in text:
        return robot.pose(text)
    joints: dict[str, float] = {}
    for item in text.split(","):
        name, _, value = item.partition("=")
        try:
            joints[name.strip()] = float(value)
        except ValueError as cause:
            raise RobotError(f"--pose: '{item}' is not JOINT=VALUE [rad, m].") from cause
    return robot.configuration(**joints)


def _figures(robot: Robot, q: FloatArray, contact: str, axes: str) -> dict[str, Any]:
    """Return the metrics by name, tensors as nested lists."""
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set("xyz"):
        raise WbcError(f"--axes '{axes}': name some of x, y, z, each once.")
    main = "z" if "z" in axes else axes[-1]
    way = "up" if main == "z" else f"along {main}"
    up = np.array([1.0 if axis == main else 0.0 for axis in axes])
    force = force_capability(robot, q, contact, axes).along(up)
    found: dict[str, Any] = {
        "GIT [kg]": generalized_inertia(robot, q, contact, axes).tolist(),
        "Backward-GIT [kg]": backward_generalized_inertia(robot, q, contact, axes).tolist(),
    }
    try:
        forward = forward_generalized_inertia(robot, q, contact, axes)
        found["Forward-GIT [kg]"] = forward.tolist()
    except DynamicsError as reason:
        found["Forward-GIT [kg]"] = str(reason)
    found[f"force {way}, lossless [N]"] = force.conventional
    found[f"force {way}, lift [N]"] = force.lift
    found[f"force {way}, hold [N]"] = force.hold if np.isfinite(force.hold) else "unlimited"
    for name, directions in (("conservative", 0.0), ("dissipative", -1.0)):
        mitigation = impact_mitigation(robot, q, contact, axes, directions)
        found[f"IMF {way}, {name}"] = mitigation.along(up)
    return found


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        return "\n".join("  ".join(f"{x:9.4f}" for x in row) for row in value)
    return f"{value:.6g}"


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
