"""The same controller and inputs give the same bits in another process, and from a file."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

from sims.legged import controller, feet
from wbc.control import Controller, ControllerSettings
from wbc.control.qp.problem import QPProblem
from wbc.effects import load_robot
from wbc.robot import Motion


def run(path: str, clutter: int) -> None:
    """Take ticks of Talos after `clutter` arrays on the heap; write states, commands, programs."""
    kept = [np.ones(size) for size in range(clutter)]
    talos = load_robot("talos")
    tasks = controller(talos, talos).tasks
    control = Controller(talos, tasks, feet(talos), settings=ControllerSettings(solver="daqp"))
    q, generator = talos.poses["half_sitting"], np.random.default_rng(0)
    ticks = {name: [] for name in ("position", "velocity", "torque", "acceleration", "solution")}
    for _ in range(40):
        at = pin.integrate(talos.model, q, 0.01 * generator.normal(size=36))
        velocity = 0.05 * generator.normal(size=36)
        command = control.step(Motion(at, velocity))
        assert command.status.usable
        values = (at, velocity, command.rotor_torque, command.acceleration, command.solution.x)
        for column, value in zip(ticks.values(), values, strict=True):
            column.append(value)
    control.problem.save(f"{path}.program.npz")
    np.savez(f"{path}.ticks.npz", clutter=len(kept), **ticks)


def elsewhere(path: Path, clutter: int) -> dict[str, np.ndarray]:
    """Return what `run` writes in a process with another heap and another order of hashes."""
    environment = os.environ | {"PYTHONHASHSEED": str(clutter)}
    code = f"from tests.control.test_reproducibility import run; run({str(path)!r}, {clutter})"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    with np.load(f"{path}.ticks.npz") as archive:
        return {name: archive[name] for name in archive.files}


def test_talos_is_the_same_to_the_last_bit_in_three_processes(tmp_path):
    """With daqp: what ProxQP returns depends on where its memory happens to lie."""
    run(str(tmp_path / "here"), 0)
    here = dict(np.load(tmp_path / "here.ticks.npz"))
    for clutter in (1, 60):
        there = elsewhere(tmp_path / "there", clutter)
        for name in ("position", "velocity", "acceleration", "torque", "solution"):
            np.testing.assert_array_equal(here[name], there[name], err_msg=name)
        one, other = (QPProblem.load(tmp_path / f"{n}.program.npz") for n in ("here", "there"))
        for name, mine, its in zip(one._fields, one, other, strict=True):
            np.testing.assert_array_equal(mine, its, err_msg=name)
