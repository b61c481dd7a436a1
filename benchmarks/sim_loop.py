"""The closed loop of the planar leg at 1 kHz, plant and controller timed apart."""

from __future__ import annotations

from time import process_time

import numpy as np

from benchmarks.sim_cases import DT
from sims.leg import LegControl, balanced_pose, squat
from wbc import load_robot
from wbc.dynamics import evaluate
from wbc.sim import Plant

TICKS = 300


def closed_loop(rounds: int) -> tuple[float, float, float]:
    """Return CPU seconds of a plant step, a controller tick, and its quadratic program.

    Each is the least over `rounds` of the mean over a squat of 0.3 s; the program's time is the
    median that the controller reports itself, by the clock on the wall.
    """
    robot = load_robot("planar_leg_strong")
    q = balanced_pose(robot)
    height = float(evaluate(robot, q, np.zeros(robot.model.nv)).center_of_mass[2])
    plant = Plant(robot)
    best = np.full(3, np.inf)
    for _ in range(max(1, rounds // 3)):
        control = LegControl(robot, squat(height, 0.03, 1.0), noise=0.0)
        state, spent = plant.state(q), np.zeros(2)
        for _ in range(TICKS):
            began = process_time()
            torque = control(state)
            middle = process_time()
            state = plant.step(state, torque, DT).state
            spent += middle - began, process_time() - middle
        program = float(np.median([command.solve_time for command in control.commands]))
        best = np.minimum(best, [spent[1] / TICKS, spent[0] / TICKS, program])
    return float(best[0]), float(best[1]), float(best[2])
