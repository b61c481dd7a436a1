"""What noise on the velocities and wrong efficiencies do to tracking and torque.

Solo12 squats with the gears of a worse robot, 0.8 forward and 0.75 backward. The controller is told
the truth, 0.1 too little, 0.1 too much, or that there are no losses at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from sims.closed_loop import TICK, OwnPlant
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


def run(robot: Robot, model: Robot, noise: float, duration: float) -> dict[str, float]:
    """Squat for `duration` [s] with velocity noise of deviation `noise` [rad/s]; return figures."""
    plant = OwnPlant(robot, np.array(robot.poses["standing"]))
    control, com, play = controller(robot, model), CenterOfMass(robot), squat(0.04, 1.0)
    generator = np.random.default_rng(0)
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
    duration: float = 2.0, noises: Sequence[float] = (0.0, 0.02, 0.05, 0.1)
) -> dict[tuple[float, str], dict[str, float]]:
    """Return the figures by noise and by what the controller believes."""
    solo = load_robot("solo12")
    robot = geared(solo, 0.0)
    believed = (robot, geared(solo, -WRONG), geared(solo, WRONG), robot.lossless())
    return {
        (noise, name): run(robot, model, noise, duration)
        for noise in noises
        for name, model in zip(MODELS, believed, strict=True)
    }


if __name__ == "__main__":
    results = main()
    table = Table("noise [rad/s]", "believed", *next(iter(results.values())), box=None)
    for (noise, name), figures in results.items():
        table.add_row(f"{noise:g}", name, *(f"{value:.3g}" for value in figures.values()))
    Console(width=120).print(table)
