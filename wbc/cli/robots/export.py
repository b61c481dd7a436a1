"""`wbc export`: a robot with what was found, as a file of another simulator."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from wbc.cli.shared.inputs import table_console, write_json
from wbc.cli.shared.outputs import require_outputs
from wbc.effects import load_robot
from wbc.errors import WbcError
from wbc.export import FORMATS, export_robot


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "export",
        help="a corrected robot as MJCF, URDF or Isaac Lab actuators",
        epilog="example: wbc export fitted.toml --to mjcf --file fitted.xml",
    )
    parser.add_argument("robot", metavar="ROBOT", help="shipped robot, robot.toml or fitted.toml")
    parser.add_argument("--to", required=True, choices=tuple(FORMATS), help="format of the file")
    parser.add_argument("--file", metavar="FILE", help="to write; default: the robot's name")
    parser.add_argument("--json", metavar="FILE", help="what the format cannot say, for machines")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Write the file and print what is not in it."""
    robot = load_robot(options.robot)
    ending = FORMATS[options.to]
    options.file = options.file or f"{robot.name}{ending}"
    if Path(options.file).suffix.lower() != ending:
        raise WbcError(f"--file '{options.file}': {options.to} wants a name that ends in {ending}.")
    require_outputs(options)
    exported = export_robot(robot, options.to)
    path = exported.write(options.file)
    shown = table_console(options, console)
    for title, texts in (
        ("set by hand:", exported.notes),
        (f"{options.to} cannot say:", exported.unsaid),
    ):
        if texts:
            shown.print(title)
        for text in texts:
            shown.print(f"  - {text}")
    shown.print(f"wrote {path}: links, joints and motors; shapes and pictures are not in it")
    table = {"file": str(path), "notes": exported.notes, "unsaid": exported.unsaid}
    write_json(options.json, table, console)
    return 0
