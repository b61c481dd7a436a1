"""The closed loop of the planar leg at 1 kHz by its parts, each in the loop and alone.

In the loop plant and controller take turns, and find the caches full of one another; alone each
runs through the same states by itself. Run: python -m benchmarks.sim_loop
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable
from time import thread_time_ns
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from benchmarks.sim_cases import DT
from sims.leg import LegControl, balanced_pose, squat, stance_controller
from wbc import load_robot
from wbc.control import Controller
from wbc.dynamics import evaluate
from wbc.sim import Plant, SimState

TICKS, ROUNDS = 300, 12


class Loop:
    """The leg's squat, its controller and its plant, which are timed."""

    def __init__(self) -> None:
        """Run the loop once, untimed; keep its states and what the controller was given."""
        self.robot = load_robot("planar_leg_strong")
        self.pose = balanced_pose(self.robot)
        self.plant, self.stance = Plant(self.robot), stance_controller(self.robot)
        still = np.zeros(self.robot.model.nv)
        self.center = float(evaluate(self.robot, self.pose, still).center_of_mass[2])
        self.given: list[tuple[Any, ...]] = []
        self.states: list[SimState] = []
        self.torques: list[Any] = []
        control, state = self.control(self.given), self.plant.state(self.pose)
        for _ in range(TICKS):
            self.states.append(state)
            self.torques.append(control(state))
            state = self.plant.step(state, self.torques[-1], DT).state

    def control(self, given: list[tuple[Any, ...]] | None = None) -> LegControl:
        """Return a new controller; it writes down what its inner one is given, if asked to."""
        control = LegControl(self.robot, squat(self.center, 0.03, 1.0), noise=0.0)
        if given is not None:
            control._stance = _Written(control._stance, given)  # type: ignore[assignment]
        return control

    def seconds(self) -> dict[str, list[int]]:
        """Return the CPU time [ns] of every tick of every part, in one run of each."""
        control = self.control()
        found: dict[str, list[int]] = {"study": [], "plant": []}
        for k in range(TICKS):
            found["study"].append(_timed(control, self.states[k]))
            found["plant"].append(_timed(self.plant.step, self.states[k], self.torques[k], DT))
        control = self.control()
        found["study alone"] = [_timed(control, state) for state in self.states]
        found["plant alone"] = [
            _timed(self.plant.step, *pair, DT)
            for pair in zip(self.states, self.torques, strict=True)
        ]
        self.stance.reset()
        found["controller alone"] = [_timed(self.stance.step, *given) for given in self.given]
        self.stance.reset()
        found["controller"] = []
        for k in range(TICKS):
            found["controller"].append(_timed(self.stance.step, *self.given[k]))
            self.plant.step(self.states[k], self.torques[k], DT)
        return found


class _Written:
    """A controller that writes down what it is given."""

    def __init__(self, inner: Controller, given: list[tuple[Any, ...]]) -> None:
        self._inner, self._given = inner, given

    def step(self, *given: Any) -> Any:
        """Take the controller's tick."""
        self._given.append(given)
        return self._inner.step(*given)


def _timed(function: Callable[..., Any], *arguments: Any) -> int:
    began = thread_time_ns()
    function(*arguments)
    return thread_time_ns() - began


def closed_loop(rounds: int) -> dict[str, float]:
    """Return the mean CPU seconds of every part, each tick's least of `rounds` runs."""
    loop = Loop()
    runs = [loop.seconds() for _ in range(rounds)]
    return {
        name: 1e-9 * float(np.min([run[name] for run in runs], axis=0).mean()) for name in runs[0]
    }


def loop_table(rounds: int = ROUNDS) -> tuple[Table, float]:
    """Return the closed loop's table and how many times faster than real time it runs."""
    found = closed_loop(rounds)
    title = "planar leg squatting on its foot, controller and plant at 1 kHz"
    table = Table("", "in the loop [us]", "alone [us]", title=title)
    rows = {"plant step": "plant", "controller tick": "controller", "with its references": "study"}
    for label, name in rows.items():
        table.add_row(label, *(f"{1e6 * found[name + end]:.1f}" for end in ("", " alone")))
    whole = [found["plant" + end] + found["study" + end] for end in ("", " alone")]
    table.add_row("together", *(f"{1e6 * time:.1f}" for time in whole))
    table.add_row("times real time", *(f"{DT / time:.1f}" for time in whole))
    return table, DT / whole[0]


if __name__ == "__main__":
    Console(width=110).print(loop_table()[0])
    print(machine("mujoco"))
