"""`wbc rollout`: a position servo fitted so that its simulated runs follow the logs."""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import (
    add_log_options,
    command_line,
    logs_from,
    robot_from,
    table_console,
    working,
    write_json,
)
from wbc.cli.shared.outputs import require_outputs
from wbc.effects import save_robot
from wbc.files import write_text
from wbc.identification.answer.numbers import plain
from wbc.identification.servo.rollouts import Rollouts, fit_rollouts
from wbc.identification.servo.servo_models import UNITS

_EPILOG = """example:
  wbc rollout light.csv heavy.csv@heavy.toml --robot servo.toml --save fitted.toml

For a position servo whose torque nobody recorded. The whole servo is simulated from its
first position under the recorded targets: controller, winding, gear and load. Each log may
have its own robot file (LOG@ROBOT) with another gain, supply voltage or load. What is
printed as held out is the error on logs that the fit did not see."""
_GEAR = ("torque_constant", "resistance", "rotor_inertia")
_LEGEND = "mean absolute position error; each model has what those above it have"


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "rollout",
        help="a position servo fitted by simulating its runs",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_log_options(parser)
    parser.add_argument("--save", metavar="FITTED.toml", help="write the fitted servo")
    parser.add_argument("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Fit, print, write."""
    shown = table_console(options, console)
    require_outputs(options)
    robot = robot_from(options)
    logs = logs_from(options, robot)
    with working(shown, "simulating") as progress:
        found = fit_rollouts(robot, logs, progress)
    shown.print(_sentence(found))
    shown.print(_models(found))
    shown.print(_numbers(found))
    if options.save:
        shown.print(f"wrote {_save(found, options.save)}", soft_wrap=True)
        if "source_resistance" in found.chosen.fit.values:
            shown.print(
                "not in the file, because a robot file has no such number: source_resistance"
            )
    write_json(options.json, found.to_json(), console)
    return 0


def _sentence(found: Rollouts) -> str:
    chosen = found.chosen
    return (
        f"The servo as given misses its logs by {plain(1e3 * found.given, 2)} mrad; fitted, by "
        f"{plain(1e3 * chosen.seen, 2)} mrad, and by {plain(1e3 * chosen.error, 2)} mrad on logs "
        f"that the fit has not seen. It needs: {', '.join(_needs(found))}."
    )


def _needs(found: Rollouts) -> list[str]:
    return [model.name.removeprefix("and ") for model in found.models[: found.best + 1]]


def _models(found: Rollouts) -> Table:
    table = Table("model", "all logs [mrad]", "held out [mrad]", "", box=None, caption=_LEGEND)
    for column in table.columns[1:3]:
        column.justify = "right"
    for model in found.models:
        mark = "chosen" if model is found.chosen else ""
        table.add_row(model.name, plain(1e3 * model.seen, 2), plain(1e3 * model.error, 2), mark)
    return table


def _numbers(found: Rollouts) -> Table:
    fit = found.chosen.fit
    table = Table("number", "value", "unit", "", box=None)
    table.columns[1].justify = "right"
    for name, value in fit.values.items():
        unit = "" if UNITS[name] == "1" else UNITS[name]
        table.add_row(name, plain(value), unit, "at its bound" if name in fit.at_bound else "")
    return table


def _save(found: Rollouts, target: str) -> Path:
    """Write the given robot with the fitted numbers of its motor, and the effects."""
    known = {effect.key for effect in found.effects}
    kept = [effect for effect in found.robot.effects if effect.key not in known]
    base = found.robot.without_effects()
    path = save_robot(
        base.with_effects(*kept, *found.effects), target, provenance={"command": command_line()}
    )
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    fitted = found.chosen.fit.robot.transmission
    numbers = {name: float(getattr(fitted, name)[0]) for name in _GEAR}
    units = {name: UNITS[name] for name in _GEAR}
    table["gears"] = {
        fitted.joints[0]: {
            name: {"value": value, "unit": units[name], "source": "wbc rollout"}
            for name, value in numbers.items()
        }
    }
    return write_text(path, tomli_w.dumps(table))
