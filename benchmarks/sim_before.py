"""The closed loop of the planar leg at 1 kHz: this checkout beside another one, in turns.

A figure in multiples of real time belongs to one machine; the ratio of two versions that take turns
on it lasts. Both run the same squat through their own plant, controller and study. The other
checkout is a directory, for example of `git worktree add ../before 09ec769`.
Run: python -m benchmarks.sim_before ../before
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.controller import machine

TICKS, ROUNDS, DT = 300, 12, 1e-3
HERE = Path(__file__).resolve().parents[1]
PARTS = "plant", "controller with its references"

# Only what every version has, so that the same lines run in both.
_WORKER = """
import json, sys
from time import thread_time_ns
import numpy as np
from sims.leg import LegControl, balanced_pose, squat
from wbc import load_robot
from wbc.dynamics import evaluate
from wbc.sim import Plant
import wbc
robot = load_robot("planar_leg_strong")
pose = balanced_pose(robot)
height = float(evaluate(robot, pose, np.zeros(robot.model.nv)).center_of_mass[2])
plant = Plant(robot)
print(json.dumps(wbc.__file__), flush=True)
for line in sys.stdin:
    ticks, dt = json.loads(line)
    control = LegControl(robot, squat(height, 0.03, 1.0), noise=0.0)
    state, spent = plant.state(pose), []
    for _ in range(ticks):
        began = thread_time_ns()
        torque = control(state)
        middle = thread_time_ns()
        state = plant.step(state, torque, dt).state
        spent.append([thread_time_ns() - middle, middle - began])
    print(json.dumps([spent, state.position.tolist()]), flush=True)
"""


class Checkout:
    """The loop of one checkout, in a process of its own."""

    def __init__(self, root: Path) -> None:
        """Start it with this Python.

        Raises:
            FileNotFoundError: `root` holds no `wbc`.
        """
        if not (root / "wbc" / "__init__.py").is_file():
            raise FileNotFoundError(f"{root} holds no package wbc: give a checkout's directory.")
        environment = os.environ | {"PYTHONPATH": str(root)}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self.root = root
        self._process = subprocess.Popen(
            [sys.executable, "-c", _WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=root,
        )

    def ready(self) -> None:
        """Wait until its plant is built.

        Raises:
            RuntimeError: the process ended, or it imported another checkout's `wbc`.
        """
        found = Path(self._answer())
        if self.root not in found.parents:
            raise RuntimeError(f"{self.root} was asked for, but {found} was imported.")

    def run(self, ticks: int) -> tuple[list[list[int]], list[float]]:
        """Return the CPU time [ns] (ticks, 2) of plant and controller, and the last position."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([ticks, DT]) + "\n")
        self._process.stdin.flush()
        spent, position = self._answer()
        return spent, position

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"The loop of {self.root} ended; its message stands above.")
        return json.loads(line)


def side_by_side(other: Path, rounds: int, ticks: int = TICKS) -> tuple[np.ndarray, np.ndarray]:
    """Return CPU seconds (rounds, 2 checkouts, ticks, 2 parts), and both last positions (2, nq).

    The other checkout comes first. A round before them, in which all is loaded, is left out.
    """
    checkouts = [Checkout(other.resolve()), Checkout(HERE)]
    for checkout in checkouts:
        checkout.ready()
    times, ends = [], []
    for k in range(rounds + 1):
        runs = {i: checkouts[i].run(ticks) for i in ((0, 1) if k % 2 else (1, 0))}
        times.append([runs[i][0] for i in range(2)])
        ends = [runs[i][1] for i in range(2)]
    for checkout in checkouts:
        checkout.close()
    return 1e-9 * np.array(times[1:]), np.array(ends)


def main() -> None:
    """Print the times of the two checkouts and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="directory of the other checkout")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="turns of each")
    given = parser.parse_args()
    times, ends = side_by_side(given.other, given.rounds)
    least = 1e6 * times.min(axis=0).mean(axis=1)
    print(f"{'us per tick, least of all rounds':34s}{'other':>10s}{'this':>10s}{'ratio':>8s}")
    for name, (old, new) in zip((*PARTS, "together"), [*least.T, least.sum(axis=1)], strict=True):
        print(f"{name:34s}{old:10.1f}{new:10.1f}{old / new:8.2f}")
    whole = times.sum(axis=(2, 3))
    low, middle, high = np.percentile(whole[:, 0] / whole[:, 1], [0, 50, 100])
    print(f"ratio round by round: median {middle:.2f}, {low:.2f} to {high:.2f}")
    print(f"largest difference of the last positions: {np.ptp(ends, axis=0).max():.1e} m or rad")
    print(machine())


if __name__ == "__main__":
    main()
