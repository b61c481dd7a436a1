"""`wbc rollout`: a position servo fitted so that its simulated runs follow the logs."""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import tomli_w
from rich.console import Console

from wbc.cli.inputs import robot_and_logs
from wbc.cli.outputs import Outcome, command_line, working
from wbc.cli.printout import table
from wbc.effects import save_robot
from wbc.files import write_text
from wbc.identification.answer.numbers import plain
from wbc.identification.servo.servo_models import UNITS, Rollouts, fit_rollouts
from wbc.view.rows import servo_model_rows, servo_number_rows

_GEAR = ("torque_constant", "resistance", "rotor_inertia")


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Fit, print, write."""
    robot, logs = robot_and_logs(options)
    with working(console, "simulating") as progress:
        found = fit_rollouts(robot, logs, progress)
    console.print(_sentence(found))
    console.print(table(servo_model_rows(found)))
    console.print(table(servo_number_rows(found)))
    if options.save:
        console.print(f"wrote {_save(found, options.save)}", soft_wrap=True)
        if "source_resistance" in found.chosen.fit.values:
            console.print(
                "not in the file, because a robot file has no such number: source_resistance"
            )
    return 0, found.to_json()


def _sentence(found: Rollouts) -> str:
    chosen = found.chosen
    needs = [model.name.removeprefix("and ") for model in found.models[: found.best + 1]]
    return (
        f"The servo as given misses its logs by {plain(1e3 * found.given, 2)} mrad; fitted, by "
        f"{plain(1e3 * chosen.seen, 2)} mrad, and by {plain(1e3 * chosen.error, 2)} mrad on logs "
        f"that the fit has not seen. It needs: {', '.join(needs)}."
    )


def _save(found: Rollouts, target: str) -> Path:
    """Write the given robot with the fitted numbers of its motor, and the effects."""
    known = {effect.key for effect in found.effects}
    kept = [effect for effect in found.robot.effects if effect.key not in known]
    base = found.robot.without_effects()
    path = save_robot(
        base.with_effects(*kept, *found.effects), target, provenance={"command": command_line()}
    )
    written = tomllib.loads(path.read_text(encoding="utf-8"))
    fitted = found.chosen.fit.robot.transmission
    written["gears"] = {
        fitted.joints[0]: {
            name: {
                "value": float(getattr(fitted, name)[0]),
                "unit": UNITS[name],
                "source": "wbc rollout",
            }
            for name in _GEAR
        }
    }
    return write_text(path, tomli_w.dumps(written))
