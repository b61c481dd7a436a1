"""`wbc list`: the robots, effects and gearboxes there are."""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import table_console, write_json
from wbc.cli.shared.outputs import require_outputs
from wbc.effects import EFFECTS, load_robot
from wbc.errors import WbcError
from wbc.robot import robot_names


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "list",
        help="the robots, the physical effects and the gearboxes there are",
        epilog="example: wbc list effects",
    )
    parser.add_argument("what", choices=("robots", "effects", "gearboxes"))
    parser.add_argument("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Print the list."""
    require_outputs(options)
    rows = {"robots": _robots, "effects": _effects, "gearboxes": _gearboxes}[options.what]()
    table = Table(*rows[0], box=None)
    for row in rows:
        table.add_row(*row.values())
    table_console(options, console).print(table)
    write_json(options.json, {options.what: rows}, console)
    return 0


def _robots() -> list[dict[str, str]]:
    rows = []
    for name in robot_names():
        try:
            robot = load_robot(name)
            joints = ", ".join(robot.transmission.joints)
        except WbcError as error:
            rows.append({"robot": name, "driven joints": f"not available: {error}", "contacts": ""})
            continue
        contacts = ", ".join(contact.name for contact in robot.contacts)
        rows.append({"robot": name, "driven joints": joints, "contacts": contacts})
    return rows


def _effects() -> list[dict[str, str]]:
    return [
        {
            "effect": name,
            "what it is": effect.explanation,
            "parameters": ", ".join(f"{p.name} [{p.unit}]" for p in effect.parameters),
        }
        for name, effect in EFFECTS.items()
    ]


def _gearboxes() -> list[dict[str, str]]:
    from wbc.design import read_gearboxes

    rows = []
    for box in read_gearboxes().values():
        pair = f"{_number(box.forward_efficiency)}, {_number(box.backward_efficiency)}"
        rows.append(
            {
                "gearbox": box.name,
                "kind": box.kind,
                "reduction": _number(box.reduction),
                "efficiencies": pair,
                "kg m^2": _number(box.gear_inertia),
                "source": box.source,
            }
        )
    return rows


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:g}"
