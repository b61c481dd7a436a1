"""How fast the plant and MuJoCo agree as the step shrinks, on gears without losses.

In the air MuJoCo's Runge-Kutta run at 25 us is the truth; on the ground both take the same step,
and MuJoCo's contact is as stiff as that step allows. MuJoCo's leg is written from the paper's
numbers (tests/reference/mujoco_leg.py). Run: python -m benchmarks.convergence
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.reference.mujoco_leg import run
from wbc import Robot, load_robot
from wbc.sim import Plant

Torque = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)


def plant_run(robot: Robot, start: np.ndarray, torque: Torque, step: float, time: float):
    """Return q after `time` [s] under joint torques from (time, q, v), held over each step."""
    plant = Plant(robot)
    state = plant.state(start)
    for i in range(round(time / step)):
        wanted = torque((i + 0.5) * step, state.position, state.velocity)
        state = plant.step(state, wanted / robot.transmission.gear_ratio, step).state
    return state.position


def swing(time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return joint torques that swing the leg in the air."""
    return np.array([4.0 * np.sin(9.0 * time), 3.0 * np.cos(7.0 * time)])


def squatting(robot: Robot, start: np.ndarray) -> Torque:
    """Return a joint PD that squats about the pose `start`."""
    driven = robot.actuated

    def torque(time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        wish = start[driven] + np.array([-0.1, 0.2]) * np.sin(6.0 * time)
        return 400.0 * (wish - q[driven]) - 20.0 * v[driven]

    return torque


def differences() -> dict[str, list[float]]:
    """Return the largest difference of any coordinate [m, rad] for every step."""
    robot = load_robot("planar_leg_strong").lossless()
    armature = float(robot.transmission.reflected_inertia[0])
    air = robot.configuration(hip=0.4, knee=-0.9, base_z=5.0)
    truth = run(air, swing, 2.5e-5, 0.5, armature=armature, ground=False, integrator="RK4")
    stance = robot.configuration(hip=-0.5, knee=1.0, base_z=0.8 * np.cos(0.5))
    squat = squatting(robot, stance)
    rows: dict[str, list[float]] = {"in the air, to RK4": [], "sticking contact, to each other": []}
    for step in STEPS:
        ours = plant_run(robot, air, swing, step, 0.5)
        rows["in the air, to RK4"].append(float(np.abs(ours - truth).max()))
        ours = plant_run(robot, stance, squat, step, 0.4)
        theirs = run(stance, squat, step, 0.4, armature=armature, ground=True)
        rows["sticking contact, to each other"].append(float(np.abs(ours - theirs).max()))
    return rows


def main() -> dict[str, list[float]]:
    """Print the differences and the orders between neighbouring steps."""
    rows = differences()
    table = Table("step [ms]", title="largest difference of a coordinate [m, rad]")
    for name in rows:
        table.add_column(name, justify="right")
        table.add_column("order", justify="right")
    for i, step in enumerate(STEPS):
        cells = []
        for values in rows.values():
            order = f"{np.log2(values[i - 1] / values[i]):.2f}" if i else ""
            cells += [f"{values[i]:.2e}", order]
        table.add_row(f"{step * 1e3:g}", *cells)
    Console().print(table)
    return rows


if __name__ == "__main__":
    main()
