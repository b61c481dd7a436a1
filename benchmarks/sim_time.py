"""Timing steps of the plant and of MuJoCo on the same case, both called from Python."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import mujoco
import numpy as np

from benchmarks.mujoco_model import mujoco_model
from benchmarks.sim_cases import DT, Case
from wbc.sim import Plant

ROUNDS = 15


def best_time(run: Callable[[], object], count: int, rounds: int = ROUNDS) -> float:
    """Return the least CPU time [s] per call of what `run` does `count` times."""
    best = np.inf
    for _ in range(rounds):
        began = process_time()
        run()
        best = min(best, (process_time() - began) / count)
    return best


def best_in_turns(*runs: tuple[Callable[[], object], int], rounds: int = ROUNDS) -> list[float]:
    """Return the least CPU time [s] per call of several runs that take turns.

    What else the machine does meanwhile then slows all of them alike.
    """
    best = [float("inf")] * len(runs)
    for _ in range(rounds):
        best = [min(old, best_time(*run, rounds=1)) for old, run in zip(best, runs, strict=True)]
    return best


def plant_run(case: Case) -> tuple[Callable[[], None], int]:
    """Return a function that steps the plant through the case, and how many steps it takes."""
    plant, command = Plant(case.robot), case.command()
    repeats = max(1, 60 // case.steps)

    def run() -> None:
        for _ in range(repeats):
            state = case.start
            for _ in range(case.steps):
                state = plant.step(state, command(state.position, state.velocity), DT).state

    return run, repeats * case.steps


def mujoco_run(case: Case) -> tuple[Callable[[], None], int]:
    """Return the same for mj_step under the same PD, called from Python."""
    robot, gears = case.robot, case.robot.transmission
    model, command = mujoco_model(robot, DT), case.command()
    data = mujoco.MjData(model)
    position = np.array(case.start.position)
    if robot.has_free_flyer:
        position[3:7] = position[[6, 3, 4, 5]]
    repeats, order = max(1, 60 // case.steps), robot.actuated
    to_joint = gears.distribution

    def run() -> None:
        for _ in range(repeats):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = position, case.start.velocity
            for _ in range(case.steps):
                data.qfrc_applied[order] = to_joint @ command(data.qpos, data.qvel)
                mujoco.mj_step(model, data)

    return run, repeats * case.steps
