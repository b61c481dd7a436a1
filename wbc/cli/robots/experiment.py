"""`wbc experiment`: a motion that tells rival causes apart, with the odds expected of it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc.arrays import FloatArray
from wbc.cli.shared.inputs import table_console, watching, write_json
from wbc.cli.shared.outputs import require_outputs
from wbc.design.experiment import (
    BAND,
    Designed,
    FourierPath,
    MotionLimits,
    Rivals,
    design_experiment,
    expected,
    informing,
    parameter_names,
    parse_cause,
    random_paths,
    tied_rivals,
    torque_misfit,
)
from wbc.effects import load_robot
from wbc.errors import DesignError, WbcError
from wbc.files import write_text
from wbc.robot import Robot
from wbc.robot.coordinates import unit_at

_RANDOM = 21  # random motions of which the median one is shown
_SHARE = 0.01  # of the motor's torque limit: the noise of a torque sensor, where none is given

_EPILOG = """\
A cause is EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE,...; `wbc list effects`
names them, + joins several. found.json is what `wbc diagnose --json` wrote: the
causes are what it found and what it could not tell from that. One cause alone:
the motion that shrinks its intervals.

The odds are those of the cause, if true, over the other one after its numbers
are refitted: equal odds before, white noise of the torque, and nothing else
wrong with the model. Of found.json, the values that its logs leave open are
averaged over. A free base is held in a stand, the feet in the air.

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
    add("robot", metavar="ROBOT", help="shipped robot, robot.toml or fitted.toml")
    add("--lossless", action="store_true", help="start from the robot with perfect gears")
    add("--between", nargs="+", required=True, metavar="CAUSE",
        help="causes, or the found.json of a diagnosis")  # fmt: skip
    add("--duration", type=float, default=10.0, metavar="S", help="[s], default 10")
    add("--rate", type=float, default=100.0, metavar="HZ", help="rows per second, default 100")
    add("--noise", type=float, metavar="NM",
        help="noise of the measured rotor torque [N m]; default: 1 %% of its limit")  # fmt: skip
    add("--band", type=float, default=BAND, metavar="HZ",
        help=f"of torques that the diagnosis will keep, default {BAND:g}")  # fmt: skip
    add("--span", type=float, default=np.inf, metavar="RAD", help="furthest from the usual pose")
    add("--speed", type=float, default=np.inf, metavar="X", help="limit of joint speeds [rad/s]")
    add("--acceleration", type=float, default=np.inf, metavar="X", help="limit [rad/s^2]")
    add("--rounds", type=int, default=300, metavar="N", help="changes tried (default 300)")
    add("--seed", type=int, default=0, help="seed of the search (default 0)")
    add("--out", default="trajectory.csv", metavar="FILE.csv", help="the motion as set points")
    add("--figures", nargs="?", const="out", metavar="DIR", help="write motion and torques (PNG)")
    add("--theme", choices=("light", "dark"), default="light", help="colours of the figure")
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
    rivals = _rivals(options, robot)
    limits = MotionLimits.of(robot, options.span, options.speed, options.acceleration)
    _require_room(limits)
    shown = table_console(options, console)
    found = _compare(options, rivals, limits, shown)
    print_experiment(rivals, found, shown)
    path = write_set_points(options.out, robot, found["designed"].path, options.rate)
    shown.print(f"wrote {path}; see it: wbc play {path} --robot {options.robot}")
    if options.figures:
        shown.print(f"wrote {_draw(options, rivals, limits, found)}")
    write_json(options.json, _json(rivals, found, path), console)
    return 0


def _rivals(options: argparse.Namespace, robot: Robot) -> Rivals:
    texts, noise = options.between, _noise(options, robot)
    if len(texts) == 1 and texts[0].lower().endswith(".json"):
        return tied_rivals(texts[0], robot, noise, options.band)
    return Rivals(robot, tuple(parse_cause(text, robot) for text in texts), noise, options.band)


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
    chance = sorted((expected(rivals, limits, path, options.rate) for path in drawn), key=_said)
    settings = {"rate": options.rate, "rounds": options.rounds, "seed": options.seed}
    with watching("motions", console) as watch:
        classic = design_experiment(
            rivals, limits, options.duration, aim=informing, watch=watch, **settings
        )
        ours = design_experiment(
            rivals, limits, options.duration, starts=[classic.path], watch=watch, **settings
        )
    return {"random, median": chance[_RANDOM // 2], "D-optimal": classic, "designed": ours}


def _said(one: Designed) -> float:
    """Return by what random motions are put in order: the least odds, or narrow intervals."""
    narrow = -float(np.mean(np.log(np.concatenate(one.widths))))
    return one.worst if one.odds else narrow


def print_experiment(rivals: Rivals, found: Mapping[str, Designed], console: Console) -> None:
    """Print the causes and what each motion is expected to say of them; "designed" is ours."""
    for number, cause in enumerate(rivals.causes, 1):
        texts = []
        for effect in cause:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in effect.values.items())
            texts.append(f"{effect.name} at {effect.where}, {values}")
        console.print(f"cause {number}: {'; '.join(texts)}")
    designed = found["designed"]
    if rivals.pairs:
        _print_odds(found, console)
    if not rivals.pairs:
        _print_widths(rivals, found, console)
    for i, j in designed.alike:
        console.print(
            f"cause {j + 1} can do all that cause {i + 1} does: if {i + 1} is true, no motion "
            f"speaks against {j + 1}"
        )
    if rivals.robot.floating_size:
        console.print(
            "hold the base in a stand in its usual pose, the feet in the air; diagnose the run "
            'with a robot.toml that says base = "fixed"'
        )
    used = 100.0 * designed.used
    console.print(f"the designed motion uses at most {used:.0f} % of every limit")


def _print_odds(found: Mapping[str, Designed], console: Console) -> None:
    table = Table(title="expected odds, as a power of ten", box=None)
    table.add_column("if this cause is true")
    table.add_column("over")
    for name in found:
        table.add_column(name, justify="right")
    for pair in found["designed"].odds:
        told = pair not in found["designed"].alike
        cells = [f"{one.odds[pair] / np.log(10.0):.4g}" if told else "-" for one in found.values()]
        table.add_row(str(pair[0] + 1), str(pair[1] + 1), *cells)
    console.print(table)


def _print_widths(rivals: Rivals, found: Mapping[str, Designed], console: Console) -> None:
    table = Table(title="expected half widths of the 90 % intervals", box=None)
    table.add_column("parameter")
    for name in found:
        table.add_column(name, justify="right")
    for number, cause in enumerate(rivals.causes):
        for row, (effect, parameter) in enumerate(parameter_names(cause)):
            cells = [f"{one.widths[number][row]:.3g}" for one in found.values()]
            unit = "" if parameter.unit == "1" else f" [{parameter.unit}]"
            table.add_row(f"{parameter.name}, {effect.name}@{effect.where}{unit}", *cells)
    console.print(table)


def _draw(
    options: argparse.Namespace, rivals: Rivals, limits: MotionLimits, found: dict[str, Designed]
) -> Path:
    from wbc.view import DARK, LIGHT
    from wbc.view.plots import write_figure
    from wbc.view.plots.experiment import experiment_figure

    theme = DARK if options.theme == "dark" else LIGHT
    designed, robot = found["designed"], rivals.robot
    time = designed.path.times(options.rate)
    position, velocity, _ = designed.path.at(time)
    told = {pair: d for pair, d in designed.odds.items() if pair not in designed.alike}
    misfits = {}
    if told:
        pair = min(told, key=lambda key: told[key])
        misfits = {
            name: torque_misfit(rivals, limits, found[key].path, pair, options.rate)
            for name, key in (("designed", "designed"), ("random", "random, median"))
        }
    joints = {name: unit_at(robot, name, "rad") for name in robot.transmission.joints}
    figure = experiment_figure(joints, time, (position, velocity), misfits, theme=theme)
    return write_figure(Path(options.figures) / f"{robot.name}_experiment.png", figure)


def write_set_points(name: str | Path, robot: Robot, path: FourierPath, rate: float) -> Path:
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
    return {
        "causes": [
            [{"effect": e.name, "where": e.where, "parameters": e.values} for e in cause]
            for cause in rivals.causes
        ],
        "half_widths": {
            name: [widths.tolist() for widths in one.widths] for name, one in found.items()
        },
        "alike": [{"true": i, "over": j} for i, j in found["designed"].alike],
        "log10_odds": {
            name: [
                {"true": i, "over": j, "value": value / float(np.log(10.0))}
                for (i, j), value in one.odds.items()
            ]
            for name, one in found.items()
        },
        "chance": {
            name: [{"true": i, "over": j, "value": p} for (i, j), p in one.chance.items()]
            for name, one in found.items()
        },
        "used": found["designed"].used,
        "trajectory": str(path),
    }
