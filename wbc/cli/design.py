"""`wbc design`: sweep gears, links and pose of a robot; maps and the best compromises."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console

from wbc import design
from wbc.arrays import FloatArray
from wbc.cli.outputs import Options, Outcome, watching, write_figures
from wbc.cli.printout import table
from wbc.cli.robots import first_contact, pose_from
from wbc.effects import load_robot
from wbc.files import as_json
from wbc.metrics import upward
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
        path = design.run_study(study, options.out, workers=options.workers, watch=watch)
    front = design.best_designs(path, objectives)
    _print(study, front, units, objectives, console)
    console.print(f"wrote {path}: {study.size} designs")
    if options.figures:
        drawn = design.sampled_designs(path, _DRAWN)
        if (count := len(drawn["design"])) < study.size:
            console.print(f"the pictures show {count} of {study.size} designs, evenly spread")
        aimed = [objective.column for objective in objectives]
        write_figures(options, _figures(options, study, drawn, front, aimed), console)
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


def _study(options: Options) -> design.Study:
    robot = load_robot(options.robot)
    known = design.read_gearboxes(options.catalogue)
    return design.Study(
        robot=options.robot,
        parameters=tuple(design.parse_sweep(text) for text in options.sweep),
        contact=options.contact or first_contact(robot),
        position=tuple(pose_from(robot, options.pose).tolist()),
        axes=options.axes,
        direction=tuple(upward(options.axes).tolist()),
        samples=options.samples,
        seed=options.seed,
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
    study: design.Study,
    front: Columns,
    units: Mapping[str, str],
    objectives: Sequence[design.Objective],
    console: Console,
) -> None:
    """Print what varies and the goals of the front, as many rows as fit on a screen."""
    aims = ", ".join(f"{'most' if o.more else 'least'} {o.column}" for o in objectives)
    varied = [p.column for p in study.varied if p.low < p.high]
    names = dict.fromkeys([*varied, *(objective.column for objective in objectives)])
    heads = [
        f">{name.replace('_', ' ')}" + ("" if units[name] == "1" else f"\n[{units[name]}]")
        for name in names
    ]
    count = len(front["design"])
    chosen = np.unique(np.linspace(0, count - 1, min(count, _SHOWN)).round().astype(np.int_))
    cells = [[_cell(study, name, front[name][row]) for name in names] for row in chosen]
    title = f"Pareto front: {count} of {study.size} designs ({aims})"
    console.print(table(TextTable.of("|".join(heads), cells, title)))
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


def _cell(study: design.Study, name: str, value: float) -> str:
    return study.gearboxes[round(value)].name if name == "gearbox" else f"{value:.4g}"


def _figures(
    options: Options, study: design.Study, drawn: Columns, front: Columns, aimed: Sequence[str]
) -> dict[str, Callable[..., Any]]:
    """Return the files of a map and of the front in two goals, and what draws them."""
    from wbc.view.plots import design_map, pareto_figure
    from wbc.view.study_figures import MAPPED

    units = design.describe_columns(study)
    across = [p.column for p in study.varied if p.low < p.high] or ["design"]
    steps = [parameter.column for parameter in study.parameters if parameter.logarithmic]
    columns = list(dict.fromkeys([*(name for name in MAPPED if name in drawn), *aimed]))
    start = f"{options.figures}/{load_robot(study.robot).name}_design"
    show_map = partial(design_map, drawn, across, units, columns=columns, logarithmic=steps)
    figures: dict[str, Callable[..., Any]] = {f"{start}_map.png": show_map}
    if len(aimed) > 1:
        show_front = partial(pareto_figure, drawn, front, aimed[:2], across[0], units)
        figures[f"{start}_front.png"] = show_front
    return figures
