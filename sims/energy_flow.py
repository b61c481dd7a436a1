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
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from sims.leg import LegControl, balanced_pose, squat
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.dynamics import evaluate
from wbc.sim import Plant, Simulation, simulate
from wbc.view import LIGHT, Theme
from wbc.view.plots import drawing, new_figure, write_figure

OUT = Path("out")
_BAR = 0.07  # width of the bars, of the panel's
_GAP = 0.05  # between two bands, of the whole height
_SMALL = 2e-3  # share of the whole below which a band is left out


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


def flow_figure(found: dict[str, dict[str, float]], theme: Theme = LIGHT) -> Figure:
    """Return one panel per run: bands from what comes in to where it goes, as wide as joules."""
    with drawing(theme):
        figure, grid = new_figure(1, len(found), 5.4 * len(found), 4.2)
        for ax, (name, rows) in zip(grid[0], found.items(), strict=True):
            _bands(ax, rows, theme)
            ax.set_title(f"{name}: {sum(max(v, 0.0) for v in rows.values()):.3g} J come in")
    return figure


def _bands(ax: Axes, rows: dict[str, float], theme: Theme) -> None:
    ax.set_axis_off()
    ax.set_xlim(-0.55, 1.75)
    total = sum(max(value, 0.0) for value in rows.values())
    shares = {name: value / total for name, value in rows.items() if abs(value) > _SMALL * total}
    sides = {
        0: [(name, share) for name, share in shares.items() if share > 0.0],
        1: [(name, -share) for name, share in shares.items() if share < 0.0],
    }
    for side, bands in sides.items():
        inner = 0.5 * sum(share for _, share in bands)
        outer = inner + 0.5 * _GAP * (len(bands) - 1)
        for i, (name, share) in enumerate(bands):
            colour = theme.series[(i + 2 * side) % len(theme.series)]
            ends = ((outer, outer - share), (inner, inner - share))
            _band(ax, side, ends, colour)
            label = f"{name}\n{share * total:.3g} J"
            place = -_BAR - 0.02 if side == 0 else 1.0 + _BAR + 0.02
            ax.text(
                place, outer - 0.5 * share, label, ha="right" if side == 0 else "left",
                va="center", fontsize=8,
            )  # fmt: skip
            outer -= share + _GAP
            inner -= share
    ax.set_ylim(-0.5 - 3 * _GAP, 0.5 + 3 * _GAP)


def _band(
    ax: Axes, side: int, ends: tuple[tuple[float, float], tuple[float, float]], colour: str
) -> None:
    """Draw one band between the outer bar of a side and the middle of the panel."""
    (high, low), (middle_high, middle_low) = ends
    far, near = (-_BAR, 0.5) if side == 0 else (1.0 + _BAR, 0.5)
    bend = 0.5 * (far + near)
    points = [
        (far, high), (bend, high), (bend, middle_high), (near, middle_high),
        (near, middle_low), (bend, middle_low), (bend, low), (far, low), (far, high),
    ]  # fmt: skip
    curve = [Outline.CURVE4] * 3
    codes = [Outline.MOVETO, *curve, Outline.LINETO, *curve, Outline.CLOSEPOLY]
    ax.add_patch(PathPatch(Outline(points, codes), facecolor=colour, alpha=0.55, edgecolor="none"))


def report(found: dict[str, dict[str, float]]) -> list[Path]:
    """Print the books; return the figure written."""
    names = list(dict.fromkeys(name for rows in found.values() for name in rows))
    table = {run: {f"{n} [J]": rows.get(n, 0.0) for n in names} for run, rows in found.items()}
    print_columns("energy in (+) and out (-), from the audit", table)
    return [write_figure(OUT / "energy_flow.png", flow_figure(found))]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
