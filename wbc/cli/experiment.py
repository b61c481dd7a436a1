"""`wbc experiment`: a motion that tells rival causes apart, with the odds expected of it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from functools import partial

import numpy as np
from rich.console import Console

from wbc.cli.inputs import robot_from
from wbc.cli.outputs import Options, Outcome, watching, write_figures
from wbc.cli.printout import table
from wbc.design import experiment as plans
from wbc.design.experiment import DESIGNED, Designed, MotionLimits, Rivals
from wbc.errors import DesignError, WbcError
from wbc.robot import Robot
from wbc.robot.coordinates import unit_at
from wbc.tables import TextTable

Found = Mapping[str, Designed]
"""Motions by name, with what each is expected to say."""
_ODDS = "log10 of the expected odds (3: one thousand to one)"
_SHARE = 0.01  # of the motor's torque limit: the noise of a torque sensor, where none is given
_SURE = 0.99  # chance below which promises were kept less often than made, on 87 ties


def run_experiment(options: Options, console: Console) -> Outcome:
    """Design the motion, say what to expect, write the set points."""
    if options.rounds < 1:
        raise WbcError("--rounds must be at least 1.")
    robot = robot_from(options)
    rivals = _rivals(options, robot)
    limits = MotionLimits.of(robot, options.span, options.speed, options.acceleration)
    settings = {name: getattr(options, name) for name in ("rate", "rounds", "seed")}
    with watching("motions", console) as watch:
        found = plans.compare_motions(rivals, limits, options.duration, watch=watch, **settings)
    print_experiment(rivals, found, console)
    path = plans.write_set_points(options.out, robot, found[DESIGNED].path, options.rate)
    play = shlex.join(["wbc", "play", str(path), "--robot", options.robot])
    console.print(f"wrote {path}; see it: {play}")
    if options.figures:
        _draw(options, rivals, limits, found, console)
    return 0, plans.experiment_json(rivals, found) | {"trajectory": str(path)}


def _rivals(options: Options, robot: Robot) -> Rivals:
    """Return the causes that are named, or those of the one file of a diagnosis."""
    torque = robot.transmission.torque_limit
    if options.noise is None and not np.isfinite(torque).all():
        raise DesignError("--noise: the motors have no torque_limit to take 1 % of; give it.")
    noise = _SHARE * torque if options.noise is None else np.full(torque.size, options.noise)
    files = [text for text in options.between if text.lower().endswith(".json")]
    if files and len(options.between) > 1:
        raise WbcError(
            f"--between: '{files[0]}' stands beside other causes. Give one diagnosis alone."
        )
    if files:
        return plans.tied_rivals(files[0], robot, noise, options.band)
    causes = tuple(plans.parse_cause(text, robot) for text in options.between)
    return Rivals(robot, causes, noise, plans.BAND if options.band is None else options.band)


def print_experiment(rivals: Rivals, found: Found, console: Console) -> None:
    """Print the causes and what each motion is expected to say of them; "designed" is ours."""
    for number, cause in enumerate(rivals.causes, 1):
        texts = []
        for effect in cause:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in effect.values.items())
            texts.append(f"{effect.name} at {effect.where}, {values}")
        console.print(f"cause {number}: {'; '.join(texts)}")
    designed = found[DESIGNED]
    if rivals.pairs:
        _print_odds(found, console)
    else:
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
    console.print(f"the designed motion uses at most {100.0 * designed.used:.0f} % of every limit")


def _print_odds(found: Found, console: Console) -> None:
    rows = []
    for pair in found[DESIGNED].odds:
        told = pair not in found[DESIGNED].alike
        cells = [f"{one.odds[pair] / np.log(10.0):.4g}" if told else "-" for one in found.values()]
        rows.append((str(pair[0] + 1), str(pair[1] + 1), *cells))
    heads = "|".join(["if this cause is true", "over", *(f">{name}" for name in found)])
    console.print(table(TextTable.of(heads, rows, _ODDS)))
    doubted = [
        f"{i + 1} over {j + 1}"
        for (i, j), chance in found[DESIGNED].chance.items()
        if chance < _SURE and (i, j) not in found[DESIGNED].alike
    ]
    if doubted:
        console.print(
            f"less than 99 % sure to decide: {', '.join(doubted)}. Odds as low as these promise "
            "too much: on logs with known truth, fewer runs decided than such odds say"
        )


def _print_widths(rivals: Rivals, found: Found, console: Console) -> None:
    rows = []
    for number, cause in enumerate(rivals.causes):
        for row, (effect, parameter) in enumerate(plans.parameter_names(cause)):
            cells = [f"{one.widths[number][row]:.3g}" for one in found.values()]
            unit = "" if parameter.unit == "1" else f" [{parameter.unit}]"
            rows.append((f"{parameter.name}, {effect.name}@{effect.where}{unit}", *cells))
    shares = [f"{one.width / found[plans.RANDOM].width:.2f}" for one in found.values()]
    rows.append(("geometric mean, over the random one's", *shares))
    heads = "|".join(["parameter", *(f">{name}" for name in found)])
    title = "expected half widths of the 90 % intervals"
    console.print(table(TextTable.of(heads, rows, title)))


def _draw(
    options: Options, rivals: Rivals, limits: MotionLimits, found: Found, console: Console
) -> None:
    """Draw the motion, and what the wrong cause of the pair that is told worst leaves."""
    from wbc.view.study_figures import experiment_figure

    designed, robot = found[DESIGNED], rivals.robot
    time = designed.path.times(options.rate)
    told = [(odds, pair) for pair, odds in designed.odds.items() if pair not in designed.alike]
    shown = {"designed": designed, "random": found[plans.RANDOM]} if told else {}
    misfits = {
        name: plans.torque_misfit(rivals, limits, one.path, min(told)[1], options.rate)
        for name, one in shown.items()
    }
    joints = {name: unit_at(robot, name, "rad") for name in robot.transmission.joints}
    draw = partial(experiment_figure, joints, time, designed.path.at(time)[:2], misfits)
    write_figures(options, {f"{options.figures}/{robot.name}_experiment.png": draw}, console)
