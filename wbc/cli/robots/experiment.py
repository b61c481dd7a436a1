"""`wbc experiment`: a motion that tells rival causes apart, with the odds expected of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc.arrays import FloatArray
from wbc.cli.shared.inputs import table_console, watching, write_json
from wbc.cli.shared.outputs import require_outputs
from wbc.design.experiment import (
    Designed,
    FourierPath,
    MotionLimits,
    Rivals,
    design_experiment,
    expected,
    informing,
    parse_rival,
    random_paths,
)
from wbc.effects import load_robot
from wbc.errors import DesignError, WbcError
from wbc.files import write_text
from wbc.robot import Robot

_RANDOM = 21  # random motions of which the median one is shown
_SHARE = 0.01  # of the motor's torque limit: the noise of a torque sensor, where none is given

_EPILOG = """\
A cause is EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE,...; `wbc list effects`
names them. The odds are those of the cause, if true, over the other one after
its parameters are refitted: equal odds before, white noise of the torque, and
nothing else wrong with the model.

example: wbc experiment planar_leg_fixed --lossless --speed 6 --span 1
  --between rotor_inertia@knee payload_mass@shin --out trajectory.csv"""


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "experiment",
        help="a motion that tells rival causes apart, and its expected odds",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("robot", metavar="ROBOT", help="shipped robot, robot.toml or fitted.toml; base fixed")
    add("--lossless", action="store_true", help="start from the robot with perfect gears")
    add("--between", nargs="+", required=True, metavar="CAUSE", help="two causes or more")
    add("--duration", type=float, default=10.0, metavar="S", help="[s], default 10")
    add("--rate", type=float, default=100.0, metavar="HZ", help="rows per second, default 100")
    add("--noise", type=float, metavar="NM",
        help="of the measured rotor torque [N m]; default: 1 %% of its limit")  # fmt: skip
    add("--span", type=float, default=np.inf, metavar="RAD", help="furthest from the usual pose")
    add("--speed", type=float, default=np.inf, metavar="X", help="limit of joint speeds [rad/s]")
    add("--acceleration", type=float, default=np.inf, metavar="X", help="limit [rad/s^2]")
    add("--rounds", type=int, default=300, metavar="N", help="changes tried (default 300)")
    add("--seed", type=int, default=0, help="of the search (default 0)")
    add("--out", default="trajectory.csv", metavar="FILE.csv", help="the motion as set points")
    add("--json", metavar="FILE", help="the odds for machines ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Design the motion, say what to expect, write the set points."""
    require_outputs(options)
    if Path(options.out).suffix.lower() != ".csv":
        raise WbcError(f"--out '{options.out}': the name must end in .csv.")
    if options.rounds < 1:
        raise WbcError("--rounds must be at least 1.")
    robot = load_robot(options.robot)
    robot = robot.lossless() if options.lossless else robot
    rivals = Rivals(
        robot, tuple(parse_rival(text, robot) for text in options.between), _noise(options, robot)
    )
    limits = MotionLimits.of(robot, options.span, options.speed, options.acceleration)
    _require_room(limits)
    shown = table_console(options, console)
    found = _compare(options, rivals, limits, shown)
    _print(rivals, found, shown)
    path = _write(options.out, robot, found["designed"].path, options.rate)
    shown.print(f"wrote {path}")
    write_json(options.json, _json(rivals, found, path), console)
    return 0


def _noise(options: argparse.Namespace, robot: Robot) -> FloatArray:
    gears = robot.transmission
    if options.noise is not None:
        return np.full(gears.size, options.noise)
    if not np.isfinite(gears.torque_limit).all():
        raise DesignError("--noise: the motors have no torque_limit to take 1 % of; give it.")
    return np.asarray(_SHARE * gears.torque_limit)


def _require_room(limits: MotionLimits) -> None:
    bounded = np.isfinite(limits.speed) | np.isfinite(limits.acceleration)
    if not np.all(bounded | np.isfinite(limits.torque)):
        raise DesignError(
            "nothing limits how fast the robot moves; give --speed, --acceleration, or motors "
            "with a torque_limit."
        )


def _compare(
    options: argparse.Namespace, rivals: Rivals, limits: MotionLimits, console: Console
) -> dict[str, Designed]:
    """Return the designed motion beside a random and a D-optimal one."""
    drawn = random_paths(rivals, limits, options.duration, options.seed + 1, _RANDOM)
    chance = sorted(
        (expected(rivals, limits, path, options.rate) for path in drawn), key=lambda d: d.worst
    )
    settings = {"rate": options.rate, "rounds": options.rounds, "seed": options.seed}
    with watching("motions", console) as watch:
        classic = design_experiment(
            rivals, limits, options.duration, aim=informing, watch=watch, **settings
        )
        ours = design_experiment(
            rivals, limits, options.duration, starts=[classic.path], watch=watch, **settings
        )
    return {"random, median": chance[_RANDOM // 2], "D-optimal": classic, "designed": ours}


def _print(rivals: Rivals, found: dict[str, Designed], console: Console) -> None:
    for number, effect in enumerate(rivals.effects, 1):
        values = ", ".join(f"{name} = {value:g}" for name, value in effect.values.items())
        console.print(f"cause {number}: {effect.name} at {effect.where}, {values}")
    table = Table(title="expected odds, as a power of ten", box=None)
    table.add_column("if this cause is true")
    table.add_column("over")
    for name in found:
        table.add_column(name, justify="right")
    for i, j in found["designed"].odds:
        cells = [f"{one.odds[i, j] / np.log(10.0):.4g}" for one in found.values()]
        table.add_row(str(i + 1), str(j + 1), *cells)
    console.print(table)
    used = 100.0 * found["designed"].used
    console.print(f"the designed motion uses at most {used:.0f} % of every limit")


def _write(name: str, robot: Robot, path: FourierPath, rate: float) -> Path:
    """Write time, position, velocity and acceleration of every driven joint."""
    time = path.times(rate)
    joints, parts = robot.transmission.joints, path.at(time)
    heads = ["time"]
    columns = [time]
    for i, joint in enumerate(joints):
        for what, values in zip(("position", "velocity", "acceleration"), parts, strict=True):
            heads.append(f"{joint}.{what}")
            columns.append(values[:, i])
    rows = [",".join(heads)]
    rows += [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    return write_text(name, "\n".join(rows) + "\n")


def _json(rivals: Rivals, found: dict[str, Designed], path: Path) -> dict[str, Any]:
    effects = rivals.effects
    return {
        "causes": [{"effect": e.name, "where": e.where, "parameters": e.values} for e in effects],
        "log10_odds": {
            name: [
                {"true": i, "over": j, "value": value / float(np.log(10.0))}
                for (i, j), value in one.odds.items()
            ]
            for name, one in found.items()
        },
        "used": found["designed"].used,
        "trajectory": str(path),
    }
