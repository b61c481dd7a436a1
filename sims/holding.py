"""What standing still costs over the efficiency of the gears, and what a push does to it.

At rest any mesh input between eta_b T and T/eta_f holds the load T: a controller that knows the
interval may let friction carry the rest (least torque). For the wedge the middle of the interval
is T itself, so that its safest choice (most margin) and the lossless one (neutral) are the same.
Noise in the measured speeds eats into the saving: a gear that may be turning is not known to hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sims.leg import balanced_pose, with_gears
from sims.plots import Panel, sweep_figure, write_figures
from sims.stander import standing_cost, standing_loop
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.control import RestPolicy
from wbc.sim import Plant, SimState, Simulation, simulate
from wbc.transmission import wedge_backward_efficiency
from wbc.view import LIGHT, Theme, write_playback

OUT = Path("out")
_QUIET = (0.5, 0.999)  # [s] between which the cost of standing is taken
_PUSHED = (1.0, 1.1)  # [s] between which something pushes the base
LABELS = {"neutral": "neutral: the whole load T", "least torque": "least torque: $\\eta_b$ T"}
_NOISE = 2e-3  # [m/s, rad/s] of the speeds that a second run measures


@dataclass(frozen=True)
class Hold:
    """A leg that stands and is pushed, and the figures of the table."""

    run: Simulation
    figures: dict[str, float]


def stand(robot: Robot, policy: RestPolicy, push: float, recovery: float) -> Hold:
    """Stand for a second, take a push [N] for 0.1 s at the base, and recover."""
    plant, q = Plant(robot), balanced_pose(robot, knee=0.9)
    force = np.zeros(robot.model.nv)
    force[robot.velocity_index("base_x")] = push

    def pushed(state: SimState) -> FloatArray | None:
        return force if _PUSHED[0] <= state.time < _PUSHED[1] else None

    loop = standing_loop(robot, q, policy)
    run = simulate(plant, loop, plant.state(q), _PUSHED[1] + recovery, external=pushed)
    noisy_loop = standing_loop(robot, q, policy, _NOISE)
    noisy = simulate(plant, noisy_loop, plant.state(q), _PUSHED[0])
    torque, heat = standing_cost(robot, run.log.between(*_QUIET))
    pitch = np.rad2deg(run.log.column("base_pitch.position"))
    figures = {
        "knee torque [N m]": torque,
        "Joule heat [W]": heat,
        "heat, noisy speeds [W]": standing_cost(robot, noisy.log.between(*_QUIET))[1],
        "push: worst pitch [deg]": float(np.abs(pitch).max()),
        "push: worst shift [mm]": 1e3 * float(np.ptp(run.log.column("base_x.position"))),
        "push: pitch left [deg]": float(abs(pitch[-1])),
    }
    return Hold(run, figures)


def main(
    efficiencies: Sequence[float] = (0.51, 0.55, 0.6, 0.7, 0.8, 1.0),
    push: float = 8.0,
    recovery: float = 2.0,
) -> dict[str, dict[float, Hold]]:
    """Return the runs of both policies over the forward efficiency of all gears (wedge)."""
    leg = load_robot("planar_leg_strong")
    return {
        policy.value.replace("_", " "): {
            e: stand(with_gears(leg, e), policy, push, recovery) for e in efficiencies
        }
        for policy in (RestPolicy.NEUTRAL, RestPolicy.LEAST_TORQUE)
    }


def panels(rows: dict[str, dict[float, Hold]]) -> list[Panel]:
    """Return torque and heat over efficiency, and the pitch after the push."""
    fine, across = np.linspace(0.505, 1.0, 80), "forward efficiency [-]"
    lossless = next(iter(rows["neutral"].values())).figures
    drawn = []
    for figure, power in (("knee torque [N m]", 1), ("Joule heat [W]", 2)):
        share = wedge_backward_efficiency(fine) ** power
        held = {"neutral": np.full(80, lossless[figure]), "least torque": share * lossless[figure]}
        points = {
            LABELS[name]: ([*row], [hold.figures[figure] for hold in row.values()])
            for name, row in rows.items()
        }
        lines = {LABELS[name]: (fine, values) for name, values in held.items()}
        title = f"standing still: {figure.split(' [')[0]}"
        drawn.append(Panel(title, across, figure, lines, points, dots="simulated"))
    pitch = {}
    for name, row in rows.items():
        log = row[min(row)].run.log
        pitch[name] = log.time, np.rad2deg(log.column("base_pitch.position"))
    (time, one), (_, other) = pitch.values()
    if np.abs(one - other).max() < 1e-2 * np.abs(one).max():
        pitch = {"both policies": (time, one)}
    return [
        *drawn,
        Panel("pushed, with the least efficient gears", "time [s]", "pitch [deg]", pitch),
    ]


def draw(rows: dict[str, dict[float, Hold]], theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return the figure of this study."""
    return {"holding": sweep_figure(panels(rows), theme=theme)}


def report(rows: dict[str, dict[float, Hold]]) -> list[Path]:
    """Print the tables; return the plot and the playback written."""
    for name, row in rows.items():
        columns = {f"{eta:g}": hold.figures for eta, hold in row.items()}
        print_columns(f"standing, {name}, over eta_f", columns)
    robot, log = load_robot("planar_leg_strong"), next(iter(rows["least torque"].values())).run.log
    page, marks = OUT / "holding.html", {"push": _PUSHED[0]}
    return [
        *write_figures(OUT, draw(rows)),
        write_playback(page, robot, log, marks=marks, title="Standing and pushed"),
    ]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
