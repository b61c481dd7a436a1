"""`wbc design`: sweep gears, links and pose of a robot; maps and the best compromises."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console

from wbc.arrays import FloatArray
from wbc.cli.outputs import Outcome, watching, write_figures
from wbc.cli.printout import table
from wbc.cli.robots import first_contact, pose_from
from wbc.design import (
    Objective,
    Study,
    best_designs,
    choose_gearboxes,
    describe_columns,
    parse_objective,
    parse_sweep,
    read_gearboxes,
    run_study,
    sampled_designs,
)
from wbc.effects import load_robot
from wbc.files import as_json
from wbc.metrics import upward
from wbc.tables import TextTable

_DRAWN = 200_000  # designs in a picture: more than it has pixels to tell apart
_SHOWN = 12  # rows of the front that fit on a screen; the JSON and the table hold all


def run_design(options: argparse.Namespace, console: Console) -> Outcome:
    """Run the study, print the front, write figures and JSON."""
    study = _study(options)
    units = describe_columns(study)
    objectives = _objectives(options, study, units)
    with watching("designs", console) as watch:
        path = run_study(study, options.out, workers=options.workers, watch=watch)
    front = best_designs(path, objectives)
    aimed = [objective.column for objective in objectives]
    varied = [p.column for p in study.varied if p.low < p.high]
    columns = list(dict.fromkeys([*varied, *aimed]))
    _print(study, front, {name: units[name] for name in columns}, objectives, console)
    console.print(f"wrote {path}: {study.size} designs")
    if options.figures:
        drawn = sampled_designs(path, _DRAWN)
        if (count := len(drawn["design"])) < study.size:
            console.print(f"the pictures show {count} of {study.size} designs, evenly spread")
        write_figures(options, _figures(options, study, drawn, front, varied, aimed), console)
    rows = [dict(zip(front, row, strict=True)) for row in zip(*front.values(), strict=True)]
    return 0, {
        "robot": study.robot,
        "contact": study.contact,
        "designs": study.size,
        "table": str(path),
        "units": units,
        "gearboxes": as_json(study.gearboxes),
        "objectives": [f"{o.column}:{'max' if o.more else 'min'}" for o in objectives],
        "front": as_json(rows, "unlimited"),
    }


def _study(options: argparse.Namespace) -> Study:
    robot = load_robot(options.robot)
    catalogue = read_gearboxes(options.catalogue)
    return Study(
        robot=options.robot,
        parameters=tuple(parse_sweep(text) for text in options.sweep),
        contact=options.contact or first_contact(robot),
        position=tuple(pose_from(robot, options.pose).tolist()),
        axes=options.axes,
        direction=tuple(upward(options.axes).tolist()),
        samples=options.samples,
        seed=options.seed,
        load=options.load,
        gearboxes=choose_gearboxes(options.gearbox, catalogue) if options.gearbox else (),
    )


def _objectives(
    options: argparse.Namespace, study: Study, units: Mapping[str, str]
) -> list[Objective]:
    if options.objective:
        return [parse_objective(text, list(units)) for text in options.objective]
    robot = load_robot(study.robot)
    # On a fixed base the impact mitigation is 1 whatever the gears.
    floating = robot.floating_size > 0
    other = Objective("impact_mitigation") if floating else Objective("backward_inertia", False)
    # Without a torque limit every design lifts without end, and the front would be one design.
    limited = bool(np.isfinite(robot.transmission.torque_limit).any()) or any(
        parameter.name == "torque_limit" for parameter in study.parameters
    )
    return [Objective("lift") if limited else Objective("holding_torque", False), other]


def _print(
    study: Study,
    front: Mapping[str, FloatArray],
    units: Mapping[str, str],
    objectives: Sequence[Objective],
    console: Console,
) -> None:
    """Print the columns of the front that have units, as many rows as fit on a screen."""
    aims = ", ".join(f"{'most' if o.more else 'least'} {o.column}" for o in objectives)
    count = len(front["design"])
    title = f"Pareto front: {count} of {study.size} designs ({aims})"
    heads = [
        f">{name.replace('_', ' ')}" + ("" if unit == "1" else f"\n[{unit}]")
        for name, unit in units.items()
    ]
    chosen = np.unique(np.linspace(0, count - 1, min(count, _SHOWN)).round().astype(np.int_))
    cells = tuple(tuple(_cell(study, name, front[name][row]) for name in units) for row in chosen)
    console.print(table(TextTable(tuple(heads), cells, title)))
    if not count:
        console.print(
            "No design can be judged: each has a goal that is infinite or undefined. In a singular "
            "pose, straight links for example, no torque moves the contact one way. Choose another "
            "--pose, or other goals with --objective."
        )
    for box in study.gearboxes:
        if box.unknown:
            console.print(f"{box.name}: no source gives {', '.join(box.unknown)}")
    if count > _SHOWN:
        console.print(f"{_SHOWN} of {count} rows, evenly spread; --json and --out hold all")


def _cell(study: Study, name: str, value: float) -> str:
    return study.gearboxes[round(value)].name if name == "gearbox" else f"{value:.4g}"


def _figures(
    options: argparse.Namespace,
    study: Study,
    drawn: Mapping[str, FloatArray],
    front: Mapping[str, FloatArray],
    varied: Sequence[str],
    aimed: Sequence[str],
) -> dict[str, Callable[..., Any]]:
    """Return the names of the pictures of a map and a front, and what draws them."""
    from wbc.view.plots import design_map, pareto_figure
    from wbc.view.study_figures import MAPPED

    across, units = list(varied) or ["design"], describe_columns(study)
    logarithmic = [parameter.column for parameter in study.parameters if parameter.logarithmic]
    columns = list(dict.fromkeys([*(name for name in MAPPED if name in drawn), *aimed]))
    start = f"{options.figures}/{load_robot(study.robot).name}_design"
    show_map = partial(design_map, drawn, across, units, columns=columns, logarithmic=logarithmic)
    figures: dict[str, Callable[..., Any]] = {f"{start}_map.png": show_map}
    if len(aimed) > 1:
        both = {name: np.concatenate([front[name], values]) for name, values in drawn.items()}
        best = np.arange(len(front["design"]))
        show_front = partial(pareto_figure, both, best, aimed[:2], across[0], units)
        figures[f"{start}_front.png"] = show_front
    return figures
