"""Steps of the plant beside MuJoCo on the same model and step, in the same run.

MuJoCo knows no directional efficiency: it gets lossless gears (armature N^2 I_r) and its own soft
contact, the plant gets the lossy gears it is for. Both have dry friction at every driven joint, and
are stepped from Python under the same Python PD. Run: python -m benchmarks.sim
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter_ns

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from benchmarks.mujoco_model import mujoco_model
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.effects import EFFECTS
from wbc.sim import Plant, SimState

DT, ROUNDS = 1e-3, 15
FRICTION = 0.02
"""Dry friction at each driven joint, as a share of the torque that its motor can give there."""


def rubbing(robot: Robot) -> Robot:
    """Return the robot with dry friction at every driven joint."""
    kind, gears = EFFECTS["coulomb_friction"], robot.transmission
    sizes = FRICTION * np.abs(gears.gear_ratio) * gears.torque_limit
    levels = zip(gears.joints, sizes, strict=True)
    return robot.with_effects(*(kind.at(joint, {"level": size}) for joint, size in levels))


@dataclass(frozen=True, eq=False)
class Case:
    """One thing to time.

    Attributes:
        robot: what is simulated.
        start: state from which the timed steps begin.
        pose: q that the PD holds.
        gain: of the PD [N m/rad].
        steps: from `start` on.
    """

    robot: Robot
    start: SimState
    pose: np.ndarray
    gain: float
    steps: int

    def torque(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return what a PD that holds the pose asks of the rotors (m,) [N m]."""
        gears, at = self.robot.transmission, self.robot.actuated_position
        error = q[at] - self.pose[at] + 0.025 * v[self.robot.actuated]
        return -self.gain * error / gears.gear_ratio


def held(robot: Robot, pose: np.ndarray, gain: float, steps: int, settle: int = 20) -> Case:
    """Return the case of a robot that has held `pose` for some steps."""
    plant = Plant(robot)
    found = Case(robot, plant.state(pose), pose, gain, steps)
    state = found.start
    for _ in range(settle):
        state = plant.step(state, found.torque(state.position, state.velocity), DT).state
    return Case(robot, state.replace(time=0.0), pose, gain, steps)


def before_impact(robot: Robot, pose: np.ndarray, gain: float) -> Case:
    """Return the case of the one step in which the robot, falling from `pose`, lands."""
    plant = Plant(robot)
    found = Case(robot, plant.state(pose), pose, gain, 1)
    state = found.start
    while True:
        result = plant.step(state, found.torque(state.position, state.velocity), DT)
        if result.impacts:
            return Case(robot, state.replace(time=0.0), pose, gain, 1)
        state = result.state


def cases() -> dict[str, Case]:
    """Return what is timed, by name."""
    leg, solo, talos = map(rubbing, map(load_robot, ("planar_leg_strong", "solo12", "talos")))
    bent = {"hip": -0.5, "knee": 1.0}
    height = 0.8 * np.cos(0.5)
    high, low = np.array(solo.pose()), np.array(solo.pose())
    high[2], low[2] = high[2] + 50.0, low[2] + 0.05
    return {
        "planar leg, stance": held(leg, leg.configuration(**bent, base_z=height), 400.0, 200),
        "planar leg, flight": held(leg, leg.configuration(**bent, base_z=50.0), 400.0, 200),
        "planar leg, impact": before_impact(
            leg, leg.configuration(**bent, base_z=height + 0.05), 400.0
        ),
        "solo12, stance": held(solo, solo.pose(), 8.0, 120),
        "solo12, flight": held(solo, high, 8.0, 120),
        "solo12, impact": before_impact(solo, low, 8.0),
        "talos, stance": held(talos, talos.pose(), 2000.0, 80),
    }


def plant_steps(case: Case) -> Callable[[], Iterator[int]]:
    """Return what steps the plant through the case and yields the time of each step [ns]."""
    plant = Plant(case.robot)

    def steps() -> Iterator[int]:
        state = case.start
        for _ in range(case.steps):
            began = perf_counter_ns()
            state = plant.step(state, case.torque(state.position, state.velocity), DT).state
            yield perf_counter_ns() - began

    return steps


def mujoco_steps(case: Case) -> Callable[[], Iterator[int]]:
    """Return the same with mj_step under the same PD, called from Python."""
    robot, model = case.robot, mujoco_model(case.robot, DT)
    data, position = mujoco.MjData(model), np.array(case.start.position)
    if robot.has_free_flyer:
        position[3:7] = position[[6, 3, 4, 5]]
    to_joint = robot.transmission.distribution

    def steps() -> Iterator[int]:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = position, case.start.velocity
        for _ in range(case.steps):
            began = perf_counter_ns()
            data.qfrc_applied[robot.actuated] = to_joint @ case.torque(data.qpos, data.qvel)
            mujoco.mj_step(model, data)
            yield perf_counter_ns() - began

    return steps


def best_in_turns(case: Case) -> list[FloatArray]:
    """Return the least time [s] of each step (steps,) of the plant and of MuJoCo, who take turns.

    What else the machine does meanwhile then slows both alike, and no step every time.
    """
    runs, best = (plant_steps(case), mujoco_steps(case)), np.full((2, case.steps), np.inf)
    for _ in range(ROUNDS):
        for least, run in zip(best, runs, strict=True):
            for _ in range(max(1, 60 // case.steps)):
                least[:] = np.minimum(least, 1e-9 * np.array(list(run())))
    return list(best)


def main() -> None:
    """Print the table."""
    columns = ("case", "plant [us]", "MuJoCo [us]", "ratio", "longest step", "and there")
    table = Table(*columns, title=f"steps of {DT * 1e3:g} ms, mean")
    for name, case in cases().items():
        own, peer = best_in_turns(case)
        found = own.mean(), peer.mean(), own.max(), peer.max()
        shown = [f"{1e6 * time:.1f}" for time in found]
        table.add_row(name, *shown[:2], f"{found[0] / found[1]:.1f}", *shown[2:])
    Console().print(table)
    print(machine("mujoco"))


if __name__ == "__main__":
    main()
