"""`wbc experiment`: a motion that tells rival causes apart, with the odds expected of it."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from wbc.cli.outputs import Outcome, require_outputs, watching, write_figures
from wbc.cli.printout import table
from wbc.design.experiment import (
    CLASSIC,
    DESIGNED,
    RANDOM,
    Designed,
    ExperimentTask,
    FourierPath,
    MotionLimits,
    Pair,
    Rivals,
    compare_motions,
    parameter_names,
    plan_experiments,
    read_diagnosis,
    read_path,
    torque_misfit,
)
from wbc.errors import WbcError
from wbc.files import as_json
from wbc.identification.answer.ranking import effect_entry
from wbc.measurement import Log, save_log
from wbc.results import read_results
from wbc.robot import Robot
from wbc.robot.coordinates import unit_at
from wbc.tables import TextTable

_ODDS = "log10 of the expected odds (3: one thousand to one)"
_SURE = 0.99  # chance below which promises were kept less often than made, on 87 ties


def run_experiment(options: argparse.Namespace, console: Console) -> Outcome:
    """Design the motion, say what to expect, write the set points."""
    options.out = options.out or ("plans.parquet" if options.each else "trajectory.csv")
    require_outputs(options, ".parquet" if options.each else ".csv")
    if options.rounds < 1:
        raise WbcError("--rounds must be at least 1.")
    if options.each:
        return _run_each(options, console)
    task = _task(options, options.between)
    robot = task.loaded()
    rivals, limits = task.rivals(robot), task.limits(robot)
    with watching("motions", console) as watch:
        found = compare_motions(task, rivals, limits, watch)
    print_experiment(rivals, found, console)
    path = write_set_points(options.out, robot, found[DESIGNED].path, options.rate)
    play = shlex.join(["wbc", "play", str(path), "--robot", options.robot])
    console.print(f"wrote {path}; see it: {play}")
    if options.figures:
        _draw(options, rivals, limits, found, console)
    return 0, _json(rivals, found, path)


def _task(options: argparse.Namespace, between: Sequence[str]) -> ExperimentTask:
    """Return what is asked for: named causes, or the one file of a diagnosis."""
    found, files = "", [text for text in between if text.lower().endswith(".json")]
    if files and len(between) > 1:
        raise WbcError(
            f"--between: '{files[0]}' stands beside other causes. Give one diagnosis alone, or "
            "--each to plan one motion for every one of them."
        )
    if files:
        found = json.dumps(read_diagnosis(files[0]))
    names = ("robot", "lossless", "duration", "rate", "noise", "band", "span", "speed")
    given = {name: getattr(options, name) for name in (*names, "acceleration", "rounds", "seed")}
    return ExperimentTask(between=() if files else tuple(between), found=found, **given)


def _run_each(options: argparse.Namespace, console: Console) -> Outcome:
    """Plan a motion for every diagnosis, or for every two of the causes."""
    out = Path(options.out)
    tasks = [_task(options, group) for group in _groups(options.between)]
    with watching("experiments", console) as watch:
        path = plan_experiments(
            tasks, out, workers=options.workers, cluster=options.cluster, watch=watch
        )
    rows = read_results(path)
    written, robot = [path], tasks[0].loaded()
    for k, text in enumerate(rows["path"], 1):
        if text:
            place = out.with_name(f"{out.stem}_{k}.csv")
            written.append(write_set_points(place, robot, read_path(text), options.rate))
    _print_rows(rows, console)
    console.print(f"wrote {', '.join(map(str, written))}")
    return 0, as_json(rows) | {"table": str(path)}


def _groups(texts: Sequence[str]) -> list[list[str]]:
    """Return the causes of each experiment: those of one diagnosis, or two that are named."""
    files = [text for text in texts if text.lower().endswith(".json")]
    named = [text for text in texts if text not in files]
    if len(named) == 1:
        raise WbcError(f"--each: '{named[0]}' needs another cause to be told from.")
    return [[file] for file in files] + [list(pair) for pair in combinations(named, 2)]


def _print_rows(rows: Mapping[str, Any], console: Console) -> None:
    heads, lines = (">", "causes", *(f">{name}" for name in (RANDOM, CLASSIC, DESIGNED))), []
    for k, text in enumerate(rows["path"]):
        odds = [rows[f"log10_odds_{name}"][k] for name in ("random", "d_optimal", "designed")]
        cells = [f"{value:.4g}" for value in odds] if text else ["", "", "none"]
        lines.append((str(k + 1), rows["causes"][k], *cells))
    console.print(table(TextTable(heads, tuple(lines), f"least {_ODDS}")))
    for k, failure in enumerate(rows["failure"], 1):
        if failure:
            console.print(f"no motion for {k}: {failure}")


def print_experiment(rivals: Rivals, found: Mapping[str, Designed], console: Console) -> None:
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
    used = 100.0 * designed.used
    console.print(f"the designed motion uses at most {used:.0f} % of every limit")


def _print_odds(found: Mapping[str, Designed], console: Console) -> None:
    heads, lines = ("if this cause is true", "over", *(f">{name}" for name in found)), []
    for pair in found[DESIGNED].odds:
        told = pair not in found[DESIGNED].alike
        cells = [f"{one.odds[pair] / np.log(10.0):.4g}" if told else "-" for one in found.values()]
        lines.append((str(pair[0] + 1), str(pair[1] + 1), *cells))
    console.print(table(TextTable(heads, tuple(lines), _ODDS)))
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


def _print_widths(rivals: Rivals, found: Mapping[str, Designed], console: Console) -> None:
    lines: list[tuple[str, ...]] = []
    for number, cause in enumerate(rivals.causes):
        for row, (effect, parameter) in enumerate(parameter_names(cause)):
            cells = [f"{one.widths[number][row]:.3g}" for one in found.values()]
            unit = "" if parameter.unit == "1" else f" [{parameter.unit}]"
            lines.append((f"{parameter.name}, {effect.name}@{effect.where}{unit}", *cells))
    shares = [f"{one.width / found[RANDOM].width:.2f}" for one in found.values()]
    lines.append(("geometric mean, over the random one's", *shares))
    heads = ("parameter", *(f">{name}" for name in found))
    title = "expected half widths of the 90 % intervals"
    console.print(table(TextTable(heads, tuple(lines), title)))


def _draw(
    options: argparse.Namespace,
    rivals: Rivals,
    limits: MotionLimits,
    found: dict[str, Designed],
    console: Console,
) -> None:
    from wbc.view.study_figures import experiment_figure

    designed, robot = found[DESIGNED], rivals.robot
    time = designed.path.times(options.rate)
    position, velocity, _ = designed.path.at(time)
    told = {pair: d for pair, d in designed.odds.items() if pair not in designed.alike}
    misfits = {}
    if told:
        pair = min(told, key=lambda key: told[key])
        misfits = {
            name: torque_misfit(rivals, limits, found[key].path, pair, options.rate)
            for name, key in (("designed", DESIGNED), ("random", RANDOM))
        }
    joints = {name: unit_at(robot, name, "rad") for name in robot.transmission.joints}
    draw = partial(experiment_figure, joints, time, (position, velocity), misfits)
    write_figures(options, {f"{options.figures}/{robot.name}_experiment.png": draw}, console)


def write_set_points(name: str | Path, robot: Robot, path: FourierPath, rate: float) -> Path:
    """Write time, position, velocity and acceleration of every driven joint."""
    time = path.times(rate)
    parts = list(zip(("position", "velocity", "acceleration"), path.at(time), strict=True))
    joints = enumerate(robot.transmission.joints)
    columns = {f"{joint}.{what}": values[:, i] for i, joint in joints for what, values in parts}
    return save_log(Log(time, columns), name)


def _json(rivals: Rivals, found: dict[str, Designed], path: Path) -> dict[str, Any]:
    def listed(values: Mapping[Pair, float], scale: float = 1.0) -> list[dict[str, float]]:
        return [{"true": i, "over": j, "value": x / scale} for (i, j), x in values.items()]

    designed, ten = found[DESIGNED], float(np.log(10.0))
    told = {
        "causes": [[effect_entry(effect) for effect in cause] for cause in rivals.causes],
        "half_widths": {name: one.widths for name, one in found.items()},
        "alike": [{"true": i, "over": j} for i, j in designed.alike],
        "log10_odds": {name: listed(one.odds, ten) for name, one in found.items()},
        "chance": {name: listed(one.chance) for name, one in found.items()},
        "used": designed.used,
        "trajectory": path,
    }
    return dict(as_json(told))
