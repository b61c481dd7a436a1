"""Ten hops on lossy gears and a stand: flight, impact and thrust under one controller.

Three closed loops as in `sims.standing`. The motors give 100 N m after the reduction (assumed):
with the 60 N m of the standing study the leg hops too, 2 cm high and at their limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sims.hopper import Hopper
from sims.leg import balanced_pose
from sims.plots import write_figures
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.sim import Plant, Simulation, simulate
from wbc.view import LIGHT, Theme, write_playback
from wbc.view.channels import configuration, kinematics
from wbc.view.plots import drawing, new_figure, power_figure
from wbc.view.run_figures import run_style
from wbc.view.style import legend_above

OUT = Path("out")
_SHOWN = 1.2  # [s] of the knee's torque: two hops


@dataclass(frozen=True)
class Hopping:
    """One closed loop: its recording, the rise of every hop [m] and the figures of the table."""

    run: Simulation
    rises: tuple[float, ...]
    figures: dict[str, float]


def hop(plant: Robot, model: Robot, hops: int, rise: float) -> Hopping:
    """Hop and stand for a second; return the run and its figures."""
    control, ground = Hopper(model, hops, rise), Plant(plant)
    period = control.stance + 2.0 * np.sqrt(2.0 * rise / 9.81)
    duration = hops * period + control.stance + 1.0
    start = ground.state(balanced_pose(plant, knee=0.5))
    run = simulate(ground, control, start, duration)
    pitch = np.rad2deg(run.log.column("base_pitch.position"))
    torque = np.array([command.rotor_torque for command in control.commands])
    errors = np.array(control.apexes) - control.height - rise
    flow, landings = run.audit.flow, [i for i in run.impacts if i.contact_loss > 1e-3]
    figures = {
        "hops": len(control.landed),
        "apex error, rms [mm]": 1e3 * float(np.sqrt(np.mean(errors**2))),
        "pitch, worst [deg]": float(np.abs(pitch).max()),
        "pitch, at the end [deg]": float(pitch[-1]),
        "drift over ground [mm]": 1e3 * float(np.ptp(run.log.column("base_x.position")[[0, -1]])),
        "rotor torque, peak [N m]": float(np.abs(torque).max()),
        "impact impulse, mean [N s]": float(np.mean([i.contact_impulse[0, 2] for i in landings])),
        "motor work per hop [J]": flow.motor / hops,
        "lost in meshes per hop [J]": (flow.mesh + flow.impact_mesh) / hops,
        "lost in landings per hop [J]": flow.impact / hops,
        "ticks without a solution": sum(not c.status.usable for c in control.commands),
    }
    return Hopping(run, tuple(np.array(control.apexes) - control.height), figures)


def stronger_leg() -> Robot:
    """Return the leg with motors that can throw it: 5 N m on the rotor."""
    leg = load_robot("planar_leg_strong")
    return leg.with_transmission(leg.transmission.replace(torque_limit=np.full(2, 5.0)))


def main(hops: int = 10, rise: float = 0.04) -> dict[str, Hopping]:
    """Hop in three closed loops, `rise` [m] high."""
    lossy = stronger_leg()
    ideal = lossy.lossless()
    loops = {
        "dissipative": (lossy, lossy),
        "conservative": (lossy, ideal),
        "ideal": (ideal, ideal),
    }
    return {name: hop(plant, model, hops, rise) for name, (plant, model) in loops.items()}


def draw(loops: dict[str, Hopping], theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return height, rise of every hop, pitch and the knee's torque, and the power of our gears."""
    robot = stronger_leg()
    with drawing(theme):
        figure, grid = new_figure(2, 2, 10.0, 5.4)
        for i, (name, loop) in enumerate(loops.items()):
            style = run_style(i, name, theme)
            log = loop.run.log
            height = kinematics(robot, configuration(robot, log))[1][:, 2]
            grid[0][0].plot(log.time, height, **style)
            hops = np.arange(1, len(loop.rises) + 1)
            grid[0][1].plot(hops, 1e3 * np.array(loop.rises), marker="o", markersize=4, **style)
            grid[1][0].plot(log.time, np.rad2deg(log.column("base_pitch.position")), **style)
            first = log.between(0.0, _SHOWN)
            grid[1][1].plot(first.time, first.column("knee.rotor_torque"), **style)
        _label(grid)
        legend_above(figure, grid[0][0], len(loops))
    return {
        "hopping": figure,
        "hopping_power": power_figure(robot, loops["dissipative"].run.log, theme),
    }


def _label(grid: list[list[Axes]]) -> None:
    texts = (
        ("height of the centre of mass", "time [s]", "height [m]"),
        ("how far every hop rises", "hop [-]", "rise [mm]"),
        ("pitch of the base", "time [s]", "pitch [deg]"),
        ("knee torque in the first hops", "time [s]", "rotor torque [N m]"),
    )
    for ax, (title, across, up) in zip([*grid[0], *grid[1]], texts, strict=True):
        ax.set(title=title, xlabel=across, ylabel=up)
    grid[0][1].set_ylim(bottom=0.0)


def report(loops: dict[str, Hopping]) -> list[Path]:
    """Print the table; return the plots and the playback written."""
    print_columns("hopping, 100 N m motors (assumed)", {k: v.figures for k, v in loops.items()})
    robot, run = stronger_leg(), loops["dissipative"].run
    return [
        *write_figures(OUT, draw(loops)),
        write_playback(
            OUT / "hopping.html", robot, run.log, marks=run.marks, title="Ten hops on lossy gears"
        ),
    ]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
