"""What a loop around the controller needs, and that it gives the same bits each time."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pinocchio as pin

from sims.legged import controller, feet
from tests.control.scenes import points, still, usual
from wbc.control import (
    Controller,
    ControllerSettings,
    Status,
)
from wbc.control.qp.problem import QPProblem
from wbc.effects import load_robot
from wbc.robot import JointMap, Motion

SOLO = load_robot("solo12")
STAND = SOLO.pose()


def solo(**settings):
    return Controller(SOLO, usual(SOLO), points(SOLO), settings=ControllerSettings(**settings))


def test_joint_targets_are_one_step_of_the_command():
    generator = np.random.default_rng(0)
    v = 0.1 * generator.normal(size=18)
    for dt in (1e-3, 4e-3):
        command = solo().step(Motion(STAND, v), dt=dt)
        own = command.acceleration[6:]
        np.testing.assert_allclose(command.velocity, v[6:] + dt * own)
        np.testing.assert_allclose(
            command.position, STAND[7:] + dt * v[6:] + 0.5 * dt**2 * own, atol=1e-15
        )


def test_a_tick_without_a_solution_asks_drives_to_stay():
    controller = solo()
    command = controller.step(Motion(np.full(19, np.nan), np.zeros(18)))
    assert np.isnan(command.position).all()
    controller.step(still(SOLO))
    lost = controller.step(Motion(np.full(19, np.nan), np.zeros(18)))
    np.testing.assert_array_equal(lost.position, STAND[7:])
    assert not lost.velocity.any()


def test_a_hook_makes_states_of_messages():
    names = tuple(reversed(SOLO.transmission.joints))
    joints = JointMap.of(SOLO, names)

    def estimated(message):
        motion = joints.motion(*message)
        motion.position[:7] = STAND[:7]
        return motion

    hooked = solo(state_hook=estimated)
    command = hooked.step((STAND[7:][::-1], np.zeros(12)))
    plain = solo().step(still(SOLO))
    np.testing.assert_array_equal(command.rotor_torque, plain.rotor_torque)
    broken = hooked.step("no message")
    assert broken.status is Status.FAILED
    assert np.isfinite(broken.rotor_torque).all()


def test_a_second_thread_is_told_so():
    """One thread waits inside `step`, in a hook; the other gets the last good torque."""
    inside, go_on = threading.Event(), threading.Event()

    def slow(state):
        if threading.current_thread() is not threading.main_thread():
            inside.set()
            assert go_on.wait(10.0)
        return state

    controller = solo(state_hook=slow)
    state = still(SOLO)
    good = controller.step(state)
    found = []
    other = threading.Thread(target=lambda: found.append(controller.step(state)))
    other.start()
    assert inside.wait(10.0)
    refused = controller.step(state)
    go_on.set()
    other.join()
    assert refused.status is Status.BAD_INPUT
    assert "thread" in refused.message
    np.testing.assert_allclose(refused.rotor_torque, good.rotor_torque, atol=1e-12)
    assert found[0].status is Status.SOLVED
    assert controller.step(state).status is Status.SOLVED


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
    code = f"from tests.control.test_loop_interface import run; run({str(path)!r}, {clutter})"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    with np.load(f"{path}.ticks.npz") as archive:
        return {name: archive[name] for name in archive.files}


def test_talos_is_the_same_to_the_last_bit_in_two_processes(tmp_path):
    """With daqp: what ProxQP returns depends on where its memory happens to lie."""
    run(str(tmp_path / "here"), 0)
    here = dict(np.load(tmp_path / "here.ticks.npz"))
    there = elsewhere(tmp_path / "there", 60)
    for name in ("position", "velocity", "acceleration", "torque", "solution"):
        np.testing.assert_array_equal(here[name], there[name], err_msg=name)
    one, other = (QPProblem.load(tmp_path / f"{n}.program.npz") for n in ("here", "there"))
    for name, mine, its in zip(one._fields, one, other, strict=True):
        np.testing.assert_array_equal(mine, its, err_msg=name)
