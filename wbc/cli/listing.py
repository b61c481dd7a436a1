"""`wbc list`: the robots and effects there are."""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.effects import EFFECTS, load_robot
from wbc.errors import WbcError
from wbc.robot import robot_names


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "list",
        help="the robots and the physical effects there are",
        epilog="example: wbc list effects",
    )
    parser.add_argument("what", choices=("robots", "effects"))
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Print the list."""
    console.print(_robots() if options.what == "robots" else _effects())
    return 0


def _robots() -> Table:
    table = Table("robot", "driven joints", "contacts", box=None)
    for name in robot_names():
        try:
            robot = load_robot(name)
        except WbcError as error:
            table.add_row(name, f"not available: {error}", "")
            continue
        joints = ", ".join(robot.transmission.joints)
        table.add_row(name, joints, ", ".join(c.name for c in robot.contacts))
    return table


def _effects() -> Table:
    table = Table("effect", "what it is", "parameters", box=None)
    for name, effect in EFFECTS.items():
        parameters = ", ".join(f"{p.name} [{p.unit}]" for p in effect.parameters)
        table.add_row(name, effect.explanation, parameters)
    return table
