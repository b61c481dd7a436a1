"""What noise on the velocities and wrong efficiencies do to tracking and torque.

Solo12 and ANYmal squat on gears of 0.8 forward and 0.75 backward.
The controller is told the truth, 0.1 too little, 0.1 too much, or that there are no losses at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from sims.closed_loop import DEPTH, TICK, OwnPlant
from sims.legged import CenterOfMass, com_reference, controller, squat
from wbc import Robot, load_robot
from wbc.robot import Motion

FORWARD, BACKWARD, WRONG = 0.8, 0.75, 0.1
MODELS = ("exact", "0.1 too low", "0.1 too high", "conservative")


def geared(robot: Robot, shift: float) -> Robot:
    """Return the robot with the study's efficiencies, off by `shift`."""
    m = robot.transmission.size
    return robot.with_transmission(
        robot.transmission.replace(
            forward_efficiency=np.full(m, FORWARD + shift),
            backward_efficiency=np.full(m, BACKWARD + shift),
        )
    )


def run(robot: Robot, model: Robot, noise: float, duration: float, seed: int) -> dict[str, float]:
    """Squat for `duration` [s] with velocity noise of deviation `noise` [rad/s]; return figures."""
    plant = OwnPlant(robot, np.array(robot.pose()))
    control, com, play = (
        controller(robot, model),
        CenterOfMass(robot),
        squat(DEPTH[robot.name], 1.0),
    )
    generator = np.random.default_rng(seed)
    start, still = com(plant.motion), np.zeros(3)
    errors, torques, refused = [], [], 0
    for tick in range(round(duration / TICK)):
        height, _ = play(tick * TICK)
        target, wanted = com_reference(start, height)
        motion = plant.motion
        errors.append(com(motion) - target)
        seen = motion.velocity + noise * generator.normal(size=robot.model.nv)
        command = control.step(Motion(motion.position, seen), {"center_of_mass": wanted})
        refused += not command.status.usable
        torques.append(command.rotor_torque / robot.transmission.torque_limit)
        plant.advance(command.rotor_torque, still, TICK)
    size = np.linalg.norm(errors, axis=1)[round(0.1 / TICK) :]
    travel = np.abs(np.diff(torques, axis=0)).sum(axis=1).mean() / TICK
    return {
        "rms error [mm]": 1e3 * float(np.sqrt(np.mean(size**2))),
        "torque travel [limits/s]": float(travel),
        "torque, rms [% of limit]": 1e2 * float(np.sqrt(np.mean(np.square(torques)))),
        "refused ticks": refused,
    }


def main(
    duration: float = 2.0,
    noises: Sequence[float] = (0.0, 0.02, 0.05, 0.1),
    robots: Sequence[str] = ("solo12", "anymal"),
    seeds: Sequence[int] = (0, 1, 2),
) -> dict[tuple[str, float, str, int], dict[str, float]]:
    """Return the figures by robot, noise, what the controller believes, and seed (one if still)."""
    found = {}
    for robot_name in robots:
        plain = load_robot(robot_name)
        robot = geared(plain, 0.0)
        believed = (robot, geared(plain, -WRONG), geared(plain, WRONG), robot.lossless())
        for noise in noises:
            for seed in seeds if noise else seeds[:1]:
                for name, model in zip(MODELS, believed, strict=True):
                    key = robot_name, noise, name, seed
                    found[key] = run(robot, model, noise, duration, seed)
    return found


def spread(values: Sequence[float]) -> str:
    """Return the mean of the seeds, and the range where they differ in three digits."""
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return f"{np.mean(values):.3g}" + (f" ({low} to {high})" if low != high else "")


if __name__ == "__main__":
    results = main()
    figures = next(iter(results.values()))
    table = Table("robot", "noise [rad/s]", "believed", *figures, box=None)
    for where in dict.fromkeys(key[:3] for key in results):
        seeds = [run for key, run in results.items() if key[:3] == where]
        cells = (spread([run[figure] for run in seeds]) for figure in figures)
        table.add_row(where[0], f"{where[1]:g}", where[2], *cells)
    Console(width=150).print(table)
