"""What noise, late torques, slow motors and wrong efficiencies do to tracking and torque.

The planar leg, Solo12 and ANYmal squat. The controller is told the truth of its gears, efficiencies
10 % too low or too high, or that there are no losses at all; *ideal* is the same squat on perfect
gears. Between controller and plant stand the sensors' noise, a dead time, and a torque bandwidth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from sims import closed_loop, legged
from sims.closed_loop import DEPTH, ERROR, TRAVEL, OwnPlant
from sims.leg import balanced_pose, squat, stance_controller, stance_references
from sims.legged import CenterOfMass
from sims.plots import Panel, sweep_figure, write_figures
from wbc import Robot, load_robot
from wbc.robot import Motion
from wbc.sim import ClosedLoop, Plant, SensorNoise, TorqueLag, with_wrong_efficiencies

OUT = Path("out")
LEG = "planar_leg_strong"
FORWARD, BACKWARD = 0.8, 0.75  # of Solo12 and ANYmal here; the leg has its own
WRONG = 0.1
MODELS = ("exact", "10 % too low", "10 % too high", "no losses", "ideal")


@dataclass(frozen=True)
class Between:
    """What stands between a controller and its plant.

    Attributes:
        noise: standard deviation of the measured velocities [m/s, rad/s].
        delay: of the command [s].
        bandwidth: of the torque [Hz].
    """

    noise: float = 0.0
    delay: float = 0.0
    bandwidth: float = inf

    def parts(self, robot: Robot, seed: int) -> tuple[SensorNoise, TorqueLag]:
        """Return noise and lag for one run."""
        return (
            SensorNoise(robot, velocity=self.noise, seed=seed),
            TorqueLag(delay=self.delay, bandwidth=self.bandwidth),
        )


LADDER = {
    "nothing": Between(),
    "noise of 0.05 rad/s": Between(0.05),
    "and 2 ms of delay": Between(0.05, 2e-3),
    "and 50 Hz": Between(0.05, 2e-3, 50.0),
}
SWEEPS: dict[str, dict[float, Between]] = {
    "noise [rad/s]": {x: Between(noise=x) for x in (0.0, 0.02, 0.05, 0.1)},
    "delay [ms]": {1e3 * x: Between(delay=x) for x in (0.0, 2e-3, 4e-3, 6e-3)},
    "torque lag [ms]": {
        1e3 / (2.0 * np.pi * f): Between(bandwidth=f) for f in (inf, 100.0, 50.0, 25.0)
    },
}


def lossy(name: str) -> Robot:
    """Return a robot with the gears of this study."""
    robot = load_robot(name)
    if name == LEG:
        return robot
    gears, one = robot.transmission, np.ones(robot.transmission.size)
    changed = {"forward_efficiency": FORWARD * one, "backward_efficiency": BACKWARD * one}
    return robot.with_transmission(gears.replace(**changed))


def believed(robot: Robot, kind: str) -> tuple[Robot, Robot]:
    """Return the robot that the plant is and the one that the controller obeys."""
    perfect = robot.lossless()
    return {
        "exact": (robot, robot),
        "10 % too low": (robot, with_wrong_efficiencies(robot, -WRONG)),
        "10 % too high": (robot, with_wrong_efficiencies(robot, WRONG)),
        "no losses": (robot, perfect),
        "ideal": (perfect, perfect),
    }[kind]


def run(
    robot: Robot, model: Robot, between: Between, duration: float, seed: int
) -> dict[str, float]:
    """Squat for `duration` [s]; return the figures of `sims.closed_loop`."""
    noise, lag = between.parts(robot, seed)
    if robot.name != LEG:
        plant, act = OwnPlant(robot, np.array(robot.pose())), legged.squat(DEPTH[robot.name], 1.0)
        return closed_loop.run(plant, robot, model, act, duration, noise, lag)
    return run_leg(
        ClosedLoop(Plant(robot), stance_controller(model), noise=noise, lag=lag), duration
    )


def run_leg(loop: ClosedLoop, duration: float) -> dict[str, float]:
    """Squat 5 cm deep on the point foot, once in two seconds."""
    plant, robot = loop.plant, loop.plant.robot
    state, com = plant.state(balanced_pose(robot)), CenterOfMass(robot)
    path = squat(float(com(Motion(state.position, state.velocity))[2]), 0.025, 0.5)
    errors, torques, refused = [], [], 0
    for _ in range(round(duration / loop.period)):
        height = path(state.time)
        errors.append(com(Motion(state.position, state.velocity))[2:] - height[0])
        tick = loop.step(state, stance_references(height))
        refused += not tick.command.status.usable
        torques.append(tick.command.rotor_torque)
        state = tick.state
    return closed_loop.tracking(robot, errors, torques, refused)


Found = dict[tuple[str, str, str, int], dict[str, float]]


def main(
    duration: float = 1.6,
    robots: Sequence[str] = (LEG, "solo12", "anymal"),
    ladder: Mapping[str, Between] = LADDER,
    models: Sequence[str] = MODELS,
    seeds: Sequence[int] = (0,),
) -> Found:
    """Return the figures by robot, what stands between, what is believed, and seed."""
    found = {}
    for name in robots:
        robot = lossy(name)
        for label, between in ladder.items():
            for kind in models:
                for seed in seeds if between.noise else seeds[:1]:
                    pair = believed(robot, kind)
                    found[name, label, kind, seed] = run(*pair, between, duration, seed)
    return found


def sweeps(
    duration: float = 1.6, swept: Mapping[str, Mapping[float, Between]] = SWEEPS
) -> list[Panel]:
    """Return what each imperfection alone does to the leg's error, one panel each."""
    panels, leg = [], lossy(LEG)
    for across, values in swept.items():
        lines = {}
        for kind in MODELS:
            runs = [run(*believed(leg, kind), between, duration, 0) for between in values.values()]
            lines[kind] = list(values), [figures[ERROR] for figures in runs]
        panels.append(Panel("", across, "rms error [mm]", lines, log=True))
    return panels


def spread(values: Sequence[float]) -> str:
    """Return the mean of the seeds, and the range where there are several."""
    low, mean, high = (f"{value:.2f}" for value in (min(values), np.mean(values), max(values)))
    return mean if low == high else f"{mean} ({low} to {high})"


def report(found: Found, panels: Sequence[Panel]) -> list[Path]:
    """Print error and torque travel; return the plot written."""
    for figure in (ERROR, TRAVEL):
        kinds = list(dict.fromkeys(key[2] for key in found))
        table = Table("robot", "between", *kinds, title=figure, box=None)
        for robot, label in dict.fromkeys(key[:2] for key in found):
            cells = []
            for kind in kinds:
                runs = [r for key, r in found.items() if key[:3] == (robot, label, kind)]
                cells.append(spread([r[figure] for r in runs]))
            table.add_row(robot, label, *cells)
        Console(width=150).print(table)
    print(f"refused ticks: {sum(figures['refused ticks'] for figures in found.values())}")
    return write_figures(OUT, {"imperfect_loop": sweep_figure(panels)})


if __name__ == "__main__":
    for path in report(main(), sweeps()):
        print(path)
