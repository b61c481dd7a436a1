"""`wbc design`: sweep gears, links and pose of a robot; maps and the best compromises."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc.arrays import FloatArray
from wbc.cli.shared.inputs import read_logs, table_console, watching, write_json
from wbc.cli.shared.outputs import require_outputs, require_parquet
from wbc.cli.shared.sites import checked_axes, first_contact, main_direction, pose_from
from wbc.design import (
    SIMULATIONS,
    Objective,
    Study,
    best_designs,
    choose_gearboxes,
    describe_columns,
    parse_objective,
    parse_sweep,
    read_efficiency_table,
    read_gearboxes,
    run_study,
    sampled_designs,
)
from wbc.design.sweep_parameter import NAMES
from wbc.effects import load_robot
from wbc.errors import WbcError
from wbc.robot import Robot

_DRAWN = 200_000  # designs in a picture: more than it has pixels to tell apart
_SHOWN = 12  # rows of the front that fit on a screen; the JSON and the table hold all

_EPILOG = f"""\
parameters: {", ".join(NAMES[:4])},
{", ".join(NAMES[4:6])}, length.LINK, mass.LINK, joint.JOINT;
a gear parameter takes .JOINT for one gear alone. Without backward_efficiency, a
swept forward_efficiency brings the wedge's 2 - 1/eta_f. What a gearbox of the
catalogue leaves out stays the robot's own; its backward efficiency the wedge's.

example: wbc design planar_leg --sweep reduction=6:160:40:log
  --sweep forward_efficiency=0.5:0.98:40 --figures out

A run that was interrupted goes on when the same command is given again."""


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "design",
        help="sweep gears, links and pose: maps and the best compromises",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("robot", metavar="ROBOT", help="shipped robot, robot.toml or fitted.toml")
    add("--sweep", action="append", default=[], metavar="NAME=LOW:HIGH[:COUNT[:log]]",
        help="what varies, or NAME=V,V,...; give it once per parameter")  # fmt: skip
    add(
        "--gearbox",
        metavar="NAME,...|all",
        help="gearboxes of the catalogue to try (`wbc list gearboxes`)",
    )
    add("--catalogue", metavar="FILE.csv", help="another catalogue of gearboxes")
    add("--efficiency", metavar="FILE.csv",
        help="both efficiencies by load and speed, read at the load held")  # fmt: skip
    add("--joint-speed", type=float, default=0.0, metavar="X", help="for --efficiency [rad/s]")
    add("--gait", metavar="LOG", help="judge every design in the poses of a recorded motion")
    add(
        "--instants",
        type=int,
        default=20,
        metavar="N",
        help="poses taken from the gait (default 20)",
    )
    add("--samples", type=int, default=0, metavar="N", help="N Sobol samples instead of a grid")
    add("--seed", type=int, default=0, help="seed of the samples (default 0)")
    add("--simulate", default="", metavar="NAME,...",
        help=f"also simulate: {', '.join(SIMULATIONS)}")  # fmt: skip
    add("--contact", metavar="NAME", help="or a frame; default: the first contact")
    add("--pose", metavar="NAME|J=V,...", help="a named pose or joint positions [rad, m]")
    add("--axes", default="xz", help="world axes (default xz)")
    add("--load", type=float, metavar="N", help="force to hold [N]; default: each one's weight")
    add("--objective", action="append", metavar="COLUMN:max|min",
        help="goals of the front; default lift:max (holding_torque:min without torque limits)"
        " and impact_mitigation:max (backward_inertia:min on a fixed base)")  # fmt: skip
    add("--workers", type=int, default=1, metavar="N", help="processes; -1 for all cores")
    add("--cluster", metavar="ADDRESS", help="Dask scheduler to work on instead")
    add("--out", default="designs.parquet", metavar="FILE.parquet", help="the table of all designs")
    add("--figures", nargs="?", const="out", metavar="DIR", help="write map and front (PNG)")
    add("--theme", choices=("light", "dark"), default="light", help="colours of the figures")
    add("--json", metavar="FILE", help="the front for machines ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Run or resume the study, print the front, write figures and JSON."""
    require_outputs(options)
    require_parquet(options.out)
    if options.workers == 0:
        raise WbcError("--workers 0: give a number of processes, or -1 for all cores.")
    study = _study(options)
    units = describe_columns(study)
    objectives = _objectives(options, study, units)
    shown = table_console(options, console)
    with watching("designs", shown) as watch:
        path = run_study(
            study, options.out, workers=options.workers, cluster=options.cluster, watch=watch
        )
    if study.gait:
        shown.print(f"over {len(study.gait)} instants: objectives of the worst one, else the mean")
    front = best_designs(path, objectives, len(study.gait))
    _print(study, front, objectives, units, shown)
    shown.print(f"wrote {path}: {study.size} designs")
    write_json(options.json, _json(study, path, front, objectives, units), console)
    if options.figures:
        _draw(options, study, path, front, objectives, units, shown)
    return 0


def _study(options: argparse.Namespace) -> Study:
    robot = load_robot(options.robot)
    axes = checked_axes(options.axes)
    catalogue = read_gearboxes(options.catalogue)
    return Study(
        robot=options.robot,
        parameters=tuple(parse_sweep(text) for text in options.sweep),
        contact=options.contact or first_contact(robot),
        position=tuple(pose_from(robot, options.pose).tolist()),
        axes=axes,
        direction=tuple(main_direction(axes).tolist()),
        samples=options.samples,
        seed=options.seed,
        simulations=tuple(name for name in options.simulate.split(",") if name),
        load=options.load,
        gearboxes=choose_gearboxes(options.gearbox, catalogue) if options.gearbox else (),
        gait=_gait(options, robot) if options.gait else (),
        efficiency=read_efficiency_table(options.efficiency) if options.efficiency else None,
        speed=options.joint_speed,
    )


def _gait(options: argparse.Namespace, robot: Robot) -> tuple[tuple[float, ...], ...]:
    """Return rows (time, q...) at evenly spread instants of a log."""
    from wbc.view.quantities.channels import configuration

    if options.instants < 1:
        raise WbcError("--instants must be at least 1.")
    (log, *more) = read_logs([options.gait], None, robot)
    if more:
        raise WbcError(f"--gait '{options.gait}' holds several logs; name one with #NAME.")
    rows = np.unique(np.linspace(0, len(log) - 1, options.instants).round().astype(np.int_))
    poses = configuration(robot, log)[rows]
    return tuple((float(t), *q) for t, q in zip(log.time[rows], poses.tolist(), strict=True))


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


def _columns(study: Study, objectives: Sequence[Objective]) -> list[str]:
    varied = [p.column for p in study.varied if p.low < p.high and p.name != "time"]
    return list(dict.fromkeys([*varied, *(objective.column for objective in objectives)]))


def _print(
    study: Study,
    front: Mapping[str, FloatArray],
    objectives: Sequence[Objective],
    units: Mapping[str, str],
    console: Console,
) -> None:
    aims = ", ".join(f"{'most' if o.more else 'least'} {o.column}" for o in objectives)
    count, size = len(front["design"]), study.size // max(len(study.gait), 1)
    title = f"Pareto front: {count} of {size} designs ({aims})"
    columns = _columns(study, objectives)
    shown = Table(title=title, box=None)
    for name in columns:
        unit = "" if units[name] == "1" else f"\n[{units[name]}]"
        shown.add_column(name.replace("_", " ") + unit, justify="right")
    chosen = np.arange(count)
    if count > _SHOWN:
        chosen = np.linspace(0, count - 1, _SHOWN).round().astype(np.int_)
    for row in chosen:
        shown.add_row(*(_cell(study, name, front[name][row]) for name in columns))
    console.print(shown)
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


def _json(
    study: Study,
    path: Path,
    front: Mapping[str, FloatArray],
    objectives: Sequence[Objective],
    units: Mapping[str, str],
) -> dict[str, Any]:
    def plain(value: float) -> float | str | None:
        if np.isnan(value):
            return None
        return float(value) if np.isfinite(value) else "unlimited"

    count = len(front["design"])
    rows = [{name: plain(values[row]) for name, values in front.items()} for row in range(count)]
    return {
        "robot": study.robot,
        "contact": study.contact,
        "designs": study.size,
        "table": str(path),
        "units": dict(units),
        "gearboxes": [asdict(box) for box in study.gearboxes],
        "objectives": [f"{o.column}:{'max' if o.more else 'min'}" for o in objectives],
        "front": rows,
    }


def _draw(
    options: argparse.Namespace,
    study: Study,
    path: Path,
    front: Mapping[str, FloatArray],
    objectives: Sequence[Objective],
    units: Mapping[str, str],
    console: Console,
) -> None:
    from wbc.view import DARK, LIGHT
    from wbc.view.plots import design_map, pareto_figure, write_figure
    from wbc.view.plots.design import MAPPED

    table = sampled_designs(path, _DRAWN, objectives, len(study.gait))
    count, size = len(table["design"]), study.size // max(len(study.gait), 1)
    if count < size:
        console.print(f"the pictures show {count} of {size} designs, evenly spread")
    theme = DARK if options.theme == "dark" else LIGHT
    varied = [p.column for p in study.varied if p.low < p.high and p.name != "time"] or ["design"]
    logarithmic = [parameter.column for parameter in study.parameters if parameter.logarithmic]
    aimed = [objective.column for objective in objectives]
    columns = list(dict.fromkeys([*(name for name in MAPPED if name in table), *aimed]))
    figures = {
        "map": design_map(
            table, varied, units, columns=columns, logarithmic=logarithmic, theme=theme
        )
    }
    if len(objectives) > 1:
        aims = [objective.column for objective in objectives[:2]]
        both = {name: np.concatenate([front[name], values]) for name, values in table.items()}
        best = np.arange(len(front["design"]))
        figures["front"] = pareto_figure(both, best, aims, varied[0], units, theme=theme)
    for name, figure in figures.items():
        target = Path(options.figures) / f"{load_robot(study.robot).name}_design_{name}.png"
        console.print(f"wrote {write_figure(target, figure)}")
