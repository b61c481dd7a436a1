"""Where the energy goes: from the supply through motors and gears to the ground, with Joule heat.

The paper's first figure draws the flow without numbers. Here it is taken from the audit of a
recording: work of the motors in both directions, Joule heat R (tau/k_t)^2 of the same torques, what
meshes and impacts take. A squat ends where it began, so that all that the supply gave is heat; a
landing brings in the energy of the fall.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrow

from sims.leg import LegControl, balanced_pose, squat
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.dynamics import evaluate
from wbc.sim import Plant, Simulation, simulate
from wbc.transmission import Direction
from wbc.view import LIGHT, Theme
from wbc.view.palette import DIRECTION_COLOURS
from wbc.view.plots import drawing, new_figure, write_figure

OUT = Path("out")
_WIDE = 0.5  # width of the band of all energy that comes in
_FAR = 0.75  # where heat arrives below the stages, and falls begin above them
_SMALL = 2e-3  # share of the whole below which a band is left out
STAGES = {
    "supply": (),
    "motors": ("back to the supply", "Joule heat"),
    "gears": (
        "teeth of the gears",
        "impact, in the teeth",
        "rotor friction",
        "gear damping",
        "joint friction",
        "bristles",
    ),
    "links": ("fall", "stored"),
    "ground": ("impact, in the ground", "sliding on the ground", "unexplained"),
}
"""Stage -> rows of the books that enter or leave there."""


def motor_drive(robot: Robot, run: Simulation) -> float:
    """Return the work of the motors while each drives its rotor [J]; what they take back is left.

    The torque is held over each row of the recording, the speed is the mean of its two ends.
    """
    gears, log = robot.transmission, run.log
    torque = np.stack([log.column(f"{j}.rotor_torque") for j in gears.joints], axis=1)
    speed = np.stack([log.column(f"{j}.velocity") for j in gears.joints], axis=1)
    spin = (speed @ gears.motor_from_joint.T) * gears.gear_ratio
    power = torque[:-1] * 0.5 * (spin[1:] + spin[:-1])
    return float(np.maximum(power, 0.0).sum(axis=1) @ np.diff(log.time))


def books(robot: Robot, run: Simulation) -> dict[str, float]:
    """Return what comes in (+) and what goes out (-) in joule; the sum is zero."""
    flow, heat, drive = run.audit.flow, run.audit.joule_heat, motor_drive(robot, run)
    rows = {
        "supply": drive + heat,
        "Joule heat": -heat,
        "back to the supply": -(drive - flow.motor),
        **{name.replace("_", " "): -lost for name, lost in flow.losses.items()},
        "released" if run.audit.stored < 0 else "stored": -run.audit.stored,
        "unexplained": -run.audit.residual,
    }
    names = {
        "mesh": "teeth of the gears",
        "contact": "sliding on the ground",
        "impact mesh": "impact, in the teeth",
        "impact": "impact, in the ground",
        "released": "fall",
    }
    return {names.get(name, name): value for name, value in rows.items()}


def main(duration: float = 4.0) -> dict[str, dict[str, float]]:
    """Squat for `duration` [s], then land from 10 cm and come to rest; return the books of both."""
    robot = load_robot("planar_leg_strong")
    q = balanced_pose(robot)
    height = float(evaluate(robot, q, np.zeros(robot.model.nv)).center_of_mass[2])
    found = {}
    for name, lift, depth, time in (
        ("squat", 0.0, 0.025, duration),
        ("landing", 0.1, 0.0, 0.15 + 0.25 * duration),
    ):
        control = LegControl(robot, squat(height, depth, 0.5), noise=0.0)
        plant = Plant(robot)
        run = simulate(plant, control, plant.state(balanced_pose(robot, lift)), time)
        found[name] = books(robot, run)
    return found


def staged(rows: dict[str, float]) -> dict[str, float]:
    """Return the energy [J] that each stage passes to the next one, negative if it is driven."""
    passed, flow = rows["supply"], {}
    for stage, names in STAGES.items():
        passed += sum(rows.get(name, 0.0) for name in names)
        flow[stage] = passed
    return flow


def flow_figure(found: dict[str, dict[str, float]], theme: Theme = LIGHT) -> Figure:
    """Return one panel per run: bands from stage to stage, as wide as joules, heat downwards."""
    with drawing(theme):
        figure, grid = new_figure(len(found), 1, 9.0, 3.0 * len(found))
        for row, (name, books_of) in zip(grid, found.items(), strict=True):
            _stages(row[0], books_of, theme)
            total = sum(max(value, 0.0) for value in books_of.values())
            row[0].set_title(f"{name}: {total:.3g} J come in")
    return figure


def _stages(ax: Axes, rows: dict[str, float], theme: Theme) -> None:
    """Draw the stages from left to right; what leaves each goes down, what comes in, from above."""
    ax.set_axis_off()
    ax.set_aspect("equal")
    total = sum(max(value, 0.0) for value in rows.values())
    scale, flow = _WIDE / total, staged(rows)
    forward, backward = DIRECTION_COLOURS[Direction.FORWARD], DIRECTION_COLOURS[Direction.BACKWARD]
    heat = theme.series[4]
    for place, (stage, names) in enumerate(STAGES.items()):
        x = 1.6 * place
        ax.text(x, -_FAR - 0.5, stage, ha="center", va="top", weight="bold")
        shown = [name for name in names if abs(rows.get(name, 0.0)) > _SMALL * total]
        above = [
            name for name in shown if rows[name] > 0.0 or name in ("back to the supply", "stored")
        ]
        for side, group in ((1.0, above), (-1.0, [name for name in shown if name not in above])):
            left = x - 0.5 * scale * sum(abs(rows[n]) for n in group) - 0.09 * (len(group) - 1)
            for name in group:
                value, wide, enters = rows[name], scale * abs(rows[name]), rows[name] > 0.0
                colour = forward if enters else backward if side > 0.0 else heat
                middle = left + 0.5 * wide
                ends = (middle, side * _FAR), (middle, 0.0)
                _band(ax, *(ends if enters else ends[::-1]), wide, colour)
                place_of = "center" if len(group) == 1 else "right" if name == group[0] else "left"
                ax.text(
                    middle, side * (_FAR + 0.04), f"{name}\n{abs(value):.3g} J", ha=place_of,
                    va="bottom" if side > 0.0 else "top", fontsize=8,
                )  # fmt: skip
                left += wide + 0.18
        ax.plot([x, x], [-0.5 * _WIDE, 0.5 * _WIDE], color=theme.ink, linewidth=2.0)
        passed = flow[stage]
        if stage != "ground" and abs(passed) > _SMALL * total:
            colour = forward if passed > 0.0 else backward
            ends = (x, 0.0), (x + 1.6, 0.0)
            _band(ax, *(ends if passed > 0.0 else ends[::-1]), scale * abs(passed), colour)
            ax.text(x + 0.8, 0.0, f"{abs(passed):.3g} J", ha="center", va="center", fontsize=8)
    ax.set_xlim(-0.6, 1.6 * (len(STAGES) - 1) + 0.6)
    ax.set_ylim(-_FAR - 0.7, _FAR + 0.4)


def _band(
    ax: Axes, start: tuple[float, float], end: tuple[float, float], wide: float, colour: str
) -> None:
    """Draw an arrow as wide as its energy."""
    way, head = np.subtract(end, start), min(0.12, 0.6 * wide + 0.04)
    ax.add_patch(
        FancyArrow(
            *start, *way, width=wide, head_width=wide + 0.06, head_length=head,
            length_includes_head=True, color=colour, alpha=0.55, linewidth=0.0,
        )
    )  # fmt: skip


def report(found: dict[str, dict[str, float]]) -> list[Path]:
    """Print the books; return the figure written."""
    names = list(dict.fromkeys(name for rows in found.values() for name in rows))
    table = {run: {f"{n} [J]": rows.get(n, 0.0) for n in names} for run, rows in found.items()}
    print_columns("energy in (+) and out (-), from the audit", table)
    return [write_figure(OUT / "energy_flow.png", flow_figure(found))]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
