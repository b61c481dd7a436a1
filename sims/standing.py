"""Balance, squat and land on lossy gears: does the controller's model of the losses matter?

Three closed loops: the dissipative controller on the lossy plant, the conservative controller on
the same plant, and the ideal, the conservative controller on a plant with perfect gears.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sims.leg import LegControl, balanced_pose, squat
from sims.plots import write_figures
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.dynamics import evaluate
from wbc.sim import Plant, Simulation, simulate
from wbc.view import LIGHT, Theme, write_playback
from wbc.view.channels import log_impacts
from wbc.view.plots import energy_figure, power_figure, standing_figure

OUT = Path("out")


@dataclass(frozen=True)
class Loop:
    """One closed loop: what it did and the figures of the table."""

    squat: Simulation
    landing: Simulation
    figures: dict[str, float]


def rms(values: object) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(np.asarray(values)))))


def run_loop(plant: Robot, model: Robot, duration: float, title: str | None) -> Loop:
    """Squat for `duration`, then land from 10 cm, and return the figures."""
    q = balanced_pose(plant)
    height = float(evaluate(plant, q, np.zeros(plant.model.nv)).center_of_mass[2])
    legs = (
        LegControl(model, squat(height, 0.025, 0.5)),
        LegControl(model, squat(height, 0.0, 0.5)),
    )
    runs = []
    for control, lift, time in zip(
        legs, (0.0, 0.1), (duration, 0.15 + 0.5 * duration), strict=True
    ):
        ground = Plant(plant)
        start = ground.state(balanced_pose(plant, lift))
        runs.append(simulate(ground, control, start, time, progress=title))
    gears, commands = plant.transmission, legs[0].commands
    settle = len(legs[0].errors) // 4
    error = np.array(legs[0].errors[settle:])
    torque = np.array([c.rotor_torque for c in commands])
    heat = gears.resistance * (torque / gears.torque_constant) ** 2
    landing = runs[1].log.column("foot.force.z")
    ticks = [1e3 * c.tick_time for leg in legs for c in leg.commands]
    figures = {
        "height error, rms [mm]": 1e3 * rms(error[:, 0]),
        "sway, rms [mm]": 1e3 * rms(error[:, 1]),
        "pitch, rms [deg]": np.rad2deg(rms(error[:, 2])),
        "landing: height error, rms [mm]": 1e3 * rms(np.array(legs[1].errors)[:, 0]),
        "rotor torque, rms [N m]": rms(torque),
        "Joule heat [J]": float(heat.sum(axis=1).mean() * duration),
        "mesh losses [J]": runs[0].audit.flow.mesh,
        "landing: impact impulse [N s]": sum(
            float(i.contact_impulse[0, 2]) for i in runs[1].impacts
        ),
        "landing: peak force, 1 ms mean [N]": float(landing.max()),
        "QP time per tick, median [ms]": 1e3 * float(np.median([c.solve_time for c in commands])),
        "whole tick, median [ms]": float(np.median(ticks)),
        "ticks without a solution": sum(not c.status.usable for leg in legs for c in leg.commands),
    }
    return Loop(runs[0], runs[1], figures)


def main(duration: float = 4.0, progress: bool = False) -> dict[str, Loop]:
    """Run the three loops for `duration` seconds of squatting each."""
    lossy = load_robot("planar_leg_strong")
    ideal = lossy.lossless()
    loops = {
        "dissipative": (lossy, lossy),
        "conservative": (lossy, ideal),
        "ideal": (ideal, ideal),
    }
    return {
        name: run_loop(plant, model, duration, name if progress else None)
        for name, (plant, model) in loops.items()
    }


def draw(loops: dict[str, Loop], theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return squat and landing of all loops, and power and energy of the dissipative squat."""
    robot, ours = load_robot("planar_leg_strong"), loops["dissipative"].squat.log
    squats = {name: loop.squat.log for name, loop in loops.items()}
    (hit, *_) = log_impacts(robot, loops["dissipative"].landing.log)
    landings = {
        name: loop.landing.log.between(hit.time - 0.05, hit.time + 0.25)
        for name, loop in loops.items()
    }
    return {
        "squat": standing_figure(robot, squats, theme=theme),
        "landing": standing_figure(robot, landings, theme=theme),
        "power": power_figure(robot, ours, theme),
        "energy": energy_figure(robot, ours, theme),
    }


def report(loops: dict[str, Loop]) -> list[Path]:
    """Print the table; return the plots and the playback of our landing written."""
    print_columns("planar leg, 60 N m motors (assumed)", {k: v.figures for k, v in loops.items()})
    robot = load_robot("planar_leg_strong")
    page, landing = OUT / "standing.html", loops["dissipative"].landing
    title = "Landing from 10 cm on lossy gears"
    return [
        *write_figures(OUT, draw(loops)),
        write_playback(page, robot, landing.log, marks=landing.marks, title=title),
    ]


if __name__ == "__main__":
    for path in report(main(progress=True)):
        print(path)
