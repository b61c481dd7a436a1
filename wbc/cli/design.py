"""`wbc design` and `experiment`: studies over gears, motions that tell causes apart."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console

from wbc import design
from wbc.arrays import FloatArray
from wbc.cli.inputs import robot_from
from wbc.cli.outputs import Options, Outcome, watching, write_figures
from wbc.cli.robots import first_contact, pose_from
from wbc.design import experiment as plans
from wbc.design.experiment import DESIGNED, Designed, MotionLimits, Rivals
from wbc.effects import load_robot
from wbc.errors import DesignError, WbcError
from wbc.files import as_json
from wbc.metrics import upward
from wbc.robot import Robot
from wbc.tables import TextTable

_DRAWN = 200_000  # designs in a picture: more than it has pixels to tell apart
_SHOWN = 12  # rows of the front that fit on a screen; the JSON and the table hold all
Columns = Mapping[str, FloatArray]


def run_design(options: Options, console: Console) -> Outcome:
    """Run the study, print the front, write figures and JSON."""
    study = _study(options)
    units = design.describe_columns(study)
    objectives = _objectives(options, study, units)
    with watching("designs", console) as watch:
        table = design.run_study(study, options.out, watch)
    best = design.pareto_front(table, objectives)
    front = {name: values[best] for name, values in table.items()}
    _print(study, front, objectives, console)
    console.print(f"wrote {options.out}: {study.size} designs")
    if options.figures:
        drawn = {name: values[:: -(-study.size // _DRAWN)] for name, values in table.items()}
        if (count := len(drawn["design"])) < study.size:
            console.print(f"the pictures show {count} of {study.size} designs, evenly spread")
        aimed = [objective.column for objective in objectives]
        write_figures(options, _figures(study, drawn, front, aimed), console)
    rows = [dict(zip(front, row, strict=True)) for row in zip(*front.values(), strict=True)]
    return 0, {
        "robot": study.robot,
        "contact": study.contact,
        "designs": study.size,
        "table": str(options.out),
        "units": units,
        "gearboxes": as_json(study.gearboxes),
        "objectives": [f"{o.column}:{'max' if o.more else 'min'}" for o in objectives],
        "front": as_json(rows, "unlimited"),
    }


def _study(options: Options) -> design.Study:
    robot = load_robot(options.robot)
    known = design.read_gearboxes()
    return design.Study(
        robot=options.robot,
        parameters=tuple(design.parse_sweep(text) for text in options.sweep),
        contact=options.contact or first_contact(robot),
        position=tuple(pose_from(robot, options.pose).tolist()),
        axes=options.axes,
        direction=tuple(upward(options.axes).tolist()),
        load=options.load,
        gearboxes=design.choose_gearboxes(options.gearbox, known) if options.gearbox else (),
    )


def _objectives(
    options: Options, study: design.Study, units: Mapping[str, str]
) -> list[design.Objective]:
    if options.objective:
        return [design.parse_objective(text, list(units)) for text in options.objective]
    robot = load_robot(study.robot)
    # Without a torque limit every design lifts without end, and the front would be one design.
    varied = any(parameter.name == "torque_limit" for parameter in study.parameters)
    limited = varied or bool(np.isfinite(robot.transmission.torque_limit).any())
    # On a fixed base the impact mitigation is 1 whatever the gears.
    floating = robot.floating_size > 0
    return [
        design.Objective("lift") if limited else design.Objective("holding_torque", False),
        design.Objective("impact_mitigation" if floating else "backward_inertia", floating),
    ]


def _print(
    study: design.Study, front: Columns, objectives: Sequence[design.Objective], console: Console
) -> None:
    """Print what varies and the goals of the front, as many rows as fit on a screen."""
    units = design.describe_columns(study)
    aims = ", ".join(f"{'most' if o.more else 'least'} {o.column}" for o in objectives)
    varied = _varied(study)
    names = dict.fromkeys([*varied, *(objective.column for objective in objectives)])
    told = {name: "" if units[name] == "1" else f"\n[{units[name]}]" for name in names}
    heads = [f">{name.replace('_', ' ')}{unit}" for name, unit in told.items()]
    count = len(front["design"])
    chosen = np.unique(np.linspace(0, count - 1, min(count, _SHOWN)).round().astype(np.int_))
    cells = [[_cell(study, name, front[name][row]) for name in names] for row in chosen]
    title = f"Pareto front: {count} of {study.size} designs ({aims})"
    console.print(TextTable.of("|".join(heads), cells, title))
    if not count:
        goal = "infinite or undefined, as in a singular pose (straight links)"
        way = "Choose another --pose, or other --objective."
        console.print(f"No design can be judged: each has a goal that is {goal}. {way}")
    for box in study.gearboxes:
        if box.unknown:
            console.print(f"{box.name}: no source gives {', '.join(box.unknown)}")
    if count > _SHOWN:
        console.print(f"{_SHOWN} of {count} rows, evenly spread; --json and --out hold all")


def _cell(study: design.Study, name: str, value: float) -> str:
    return study.gearboxes[round(value)].name if name == "gearbox" else f"{value:.4g}"


def _varied(study: design.Study) -> list[str]:
    """Return the columns that take more than one value."""
    return [p.column for p in study.varied if len(set(p.values)) > 1]


def _figures(
    study: design.Study, drawn: Columns, front: Columns, aimed: Sequence[str]
) -> dict[str, Callable[..., Any]]:
    """Return the names of a map and of the front in two goals, and what draws them."""
    from wbc.view.plots import design_map, pareto_figure
    from wbc.view.study_figures import MAPPED

    units = design.describe_columns(study)
    across = _varied(study) or ["design"]
    steps = [parameter.column for parameter in study.parameters if parameter.logarithmic]
    columns = list(dict.fromkeys([*(name for name in MAPPED if name in drawn), *aimed]))
    name = load_robot(study.robot).name
    show_map = partial(design_map, drawn, across, units, columns, steps)
    figures: dict[str, Callable[..., Any]] = {f"{name}_design_map": show_map}
    if len(aimed) > 1:
        show_front = partial(pareto_figure, drawn, front, aimed[:2], across[0], units)
        figures[f"{name}_design_front"] = show_front
    return figures


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
        from wbc.view.study_figures import experiment_figure

        draw = partial(experiment_figure, rivals, limits, found, options.rate)
        write_figures(options, {f"{robot.name}_experiment": draw}, console)
    return 0, plans.experiment_json(rivals, found) | {"trajectory": str(path)}


def _rivals(options: Options, robot: Robot) -> Rivals:
    """Return the causes that are named, or those of the one file of a diagnosis."""
    torque = robot.transmission.torque_limit
    if options.noise is None and not np.isfinite(torque).all():
        raise DesignError("--noise: the motors have no torque_limit to take 1 % of; give it.")
    noise = _SHARE * torque if options.noise is None else np.full(torque.size, options.noise)
    for file in (text for text in options.between if text.lower().endswith(".json")):
        if len(options.between) > 1:
            way = "stands beside other causes. Give one diagnosis alone."
            raise WbcError(f"--between: '{file}' {way}")
        return plans.tied_rivals(file, robot, noise, options.band)
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
        told = f"cause {j + 1} can do all that cause {i + 1} does: if {i + 1} is true, no motion"
        console.print(f"{told} speaks against {j + 1}")
    if rivals.robot.floating_size:
        way = 'diagnose the run with a robot.toml that says base = "fixed"'
        console.print(f"hold the base in a stand in its usual pose, the feet in the air; {way}")
    console.print(f"the designed motion uses at most {100.0 * designed.used:.0f} % of every limit")


def _print_odds(found: Found, console: Console) -> None:
    rows, doubted, designed = [], [], found[DESIGNED]
    for pair in designed.odds:
        i, j = pair
        told = pair not in designed.alike
        cells = [f"{one.odds[pair] / np.log(10.0):.4g}" if told else "-" for one in found.values()]
        rows.append((str(i + 1), str(j + 1), *cells))
        doubted += [f"{i + 1} over {j + 1}"] if told and designed.chance[pair] < _SURE else []
    heads = "|".join(["if this cause is true", "over", *(f">{name}" for name in found)])
    console.print(TextTable.of(heads, rows, _ODDS))
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
    console.print(TextTable.of(heads, rows, title))
