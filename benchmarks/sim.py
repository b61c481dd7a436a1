"""Steps per second of the plant beside MuJoCo on the same model and step, in the same run.

MuJoCo knows no directional efficiency: it gets lossless gears (armature N^2 I_r) and its own soft
contact, the plant gets the lossy gears it is for. Run: python -m benchmarks.sim [--profile]
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
from collections.abc import Callable
from time import process_time

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.mujoco_model import mujoco_model
from wbc import Robot, load_robot
from wbc.sim import Plant, SimState

DT = 1e-3
ROUNDS = 7


def hold(robot: Robot, pose: np.ndarray, gain: float) -> Callable[[SimState], np.ndarray]:
    """Return a joint PD that holds a pose."""
    ratio, at_q, at_v = (
        robot.transmission.gear_ratio,
        robot.actuated_position,
        robot.actuated,
    )

    def control(state: SimState) -> np.ndarray:
        error = state.position[at_q] - pose[at_q]
        return -gain * (error + 0.025 * state.velocity[at_v]) / ratio

    return control


def plant_rate(robot: Robot, pose: np.ndarray, gain: float, steps: int, profile: bool) -> float:
    """Return the best rate [steps/s] of the plant from a pose on."""
    plant, control = Plant(robot), hold(robot, pose, gain)

    def run(state: SimState, count: int) -> SimState:
        for _ in range(count):
            state = plant.step(state, control(state), DT).state
        return state

    start = run(plant.state(pose), 20)
    best = 0.0
    for _ in range(ROUNDS):
        began = process_time()
        run(start, steps)
        best = max(best, steps / (process_time() - began))
    if profile:
        profiler = cProfile.Profile()
        profiler.runcall(run, start, steps)
        pstats.Stats(profiler).sort_stats("tottime").print_stats(15)
    return best


def mujoco_rate(robot: Robot, pose: np.ndarray, gain: float, steps: int) -> float:
    """Return the best rate [steps/s] of mj_step under the same PD, called from Python."""
    model = mujoco_model(robot, DT)
    data = mujoco.MjData(model)
    start = pose.copy()
    if robot.has_free_flyer:
        start[3:7] = pose[[6, 3, 4, 5]]
    at_q, at_v = robot.actuated_position, robot.actuated
    best = 0.0
    for _ in range(ROUNDS):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = start
        began = process_time()
        for _ in range(steps):
            error = data.qpos[at_q] - pose[at_q]
            data.qfrc_applied[at_v] = -gain * (error + 0.025 * data.qvel[at_v])
            mujoco.mj_step(model, data)
        best = max(best, steps / (process_time() - began))
    return best


def main() -> dict[str, float]:
    """Print the table; return the plant's rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--profile", action="store_true")
    profile = parser.parse_args().profile
    leg = load_robot("planar_leg_strong")
    stance = leg.configuration(hip=-0.5, knee=1.0, base_z=0.8 * np.cos(0.5))
    flight = leg.configuration(hip=-0.5, knee=1.0, base_z=50.0)
    drops = leg.configuration(hip=-0.5, knee=1.0, base_z=0.8 * np.cos(0.5) + 2e-3)
    solo, talos = load_robot("solo12"), load_robot("talos")
    cases = {
        "planar leg, stance": (leg, stance, 400.0, 200),
        "planar leg, flight": (leg, flight, 400.0, 200),
        "planar leg, landing": (leg, drops, 400.0, 60),
        "solo12, stance": (solo, np.array(next(iter(solo.poses.values()))), 8.0, 120),
        "talos, stance": (talos, np.array(next(iter(talos.poses.values()))), 2000.0, 80),
    }
    table = Table(title=f"steps per second at dt = {DT * 1e3:g} ms, one core")
    for name in ("case", "plant", "x real time", "MuJoCo", "MuJoCo / plant"):
        table.add_column(name, justify="left" if name == "case" else "right")
    rates = {}
    for name, (robot, pose, gain, steps) in cases.items():
        rate = plant_rate(robot, pose, gain, steps, profile)
        rates[name] = rate
        peer = mujoco_rate(robot, pose, gain, steps)
        table.add_row(name, f"{rate:.0f}", f"{rate * DT:.1f}", f"{peer:.0f}", f"{peer / rate:.1f}")
    Console().print(table)
    return rates


if __name__ == "__main__":
    main()
