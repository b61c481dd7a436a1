"""What the simulator is timed on: robots, poses, and a joint PD that needs no model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc import Robot, load_robot
from wbc.sim import Plant, SimState

DT = 1e-3


@dataclass(frozen=True, eq=False)
class Case:
    """One thing to time.

    Attributes:
        robot: what is simulated.
        start: state from which the timed steps begin.
        pose: q that the PD holds.
        gain: of the PD [N m/rad].
        steps: from `start` on; one means that the same step is taken again and again.
    """

    robot: Robot
    start: SimState
    pose: np.ndarray
    gain: float
    steps: int

    def command(self) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Return the PD as a function of q and v, in rotor torques."""
        gears, pose, gain = self.robot.transmission, self.pose, self.gain
        at_q, at_v = self.robot.actuated_position, self.robot.actuated

        def torque(q: np.ndarray, v: np.ndarray) -> np.ndarray:
            return -gain * (q[at_q] - pose[at_q] + 0.025 * v[at_v]) / gears.gear_ratio

        return torque


def case(robot: Robot, pose: np.ndarray, gain: float, steps: int, settle: int = 20) -> Case:
    """Return the case of a robot that has held `pose` for some steps."""
    plant = Plant(robot)
    state = plant.state(pose)
    found = Case(robot, state, pose, gain, steps)
    torque = found.command()
    for _ in range(settle):
        state = plant.step(state, torque(state.position, state.velocity), DT).state
    return Case(robot, state.replace(time=0.0), pose, gain, steps)


def before_impact(robot: Robot, pose: np.ndarray, gain: float) -> Case:
    """Return the case of the one step in which the robot, falling from `pose`, lands."""
    plant = Plant(robot)
    state, torque = plant.state(pose), Case(robot, plant.state(pose), pose, gain, 1).command()
    while True:
        result = plant.step(state, torque(state.position, state.velocity), DT)
        if result.impacts:
            return Case(robot, state.replace(time=0.0), pose, gain, 1)
        state = result.state


def cases() -> dict[str, Case]:
    """Return what is timed, by name."""
    leg, solo, talos = load_robot("planar_leg_strong"), load_robot("solo12"), load_robot("talos")
    bent = {"hip": -0.5, "knee": 1.0}
    height = 0.8 * np.cos(0.5)
    stance = leg.configuration(**bent, base_z=height)
    flight = leg.configuration(**bent, base_z=50.0)
    above = leg.configuration(**bent, base_z=height + 0.05)
    high, low = np.array(solo.pose()), np.array(solo.pose())
    high[2], low[2] = high[2] + 50.0, low[2] + 0.05
    return {
        "planar leg, stance": case(leg, stance, 400.0, 200),
        "planar leg, flight": case(leg, flight, 400.0, 200),
        "planar leg, impact": before_impact(leg, above, 400.0),
        "solo12, stance": case(solo, solo.pose(), 8.0, 120),
        "solo12, flight": case(solo, high, 8.0, 120),
        "solo12, impact": before_impact(solo, low, 8.0),
        "talos, stance": case(talos, talos.pose(), 2000.0, 80),
    }
