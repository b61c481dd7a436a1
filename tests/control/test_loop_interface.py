"""What a loop asks of a tick: weights, time steps, targets, hooks, threads and the same bits."""

import os
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sims.legged import controller, feet
from tests.control.scenes import arm, points, still
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FramePositionTask,
    JointLimit,
    PostureTask,
    Reference,
    RestPolicy,
    Status,
)
from wbc.control.inputs import LONGEST
from wbc.control.qp.solvers import QPProblem
from wbc.control.rows.tasks import Task
from wbc.effects import load_robot
from wbc.robot import JointMap, Motion
from wbc.sim import Plant, simulate, with_wrong_efficiencies
from wbc.view.channels import configuration

SOLO = load_robot("solo12")
STATE = still(SOLO)
FEET = [contact.name for contact in SOLO.contacts]
ON_THREE, STAND = dict.fromkeys(FEET[1:], np.inf), SOLO.pose()


def solo(*more, posture=0.1, **settings):
    tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=posture), *more]
    return Controller(SOLO, tasks, points(SOLO), settings=ControllerSettings(**settings))


def swing(weight=5.0):
    return FramePositionTask(name="swing", frame=SOLO.contact(FEET[0]).frame, weight=weight)


WISH = {"center_of_mass": Reference(np.array([0.01, 0.0, 0.2]))}
LIFTED = {"swing": Reference(np.array([0.2, 0.15, 0.1]))}


def test_tasks_go_on_and_off_from_tick_to_tick():
    """Rows of two tasks come and go in every order; the motion is that of a fresh controller."""
    other = FramePositionTask(name="other", frame=SOLO.contact(FEET[1]).frame, weight=5.0)
    ours = solo(swing(), other)
    orders = [(0, 1), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1), (0, 0), (1, 0), (0, 1)]
    for first, second in orders:
        shares = {"swing": float(first), "other": float(second)}
        ours.reset()
        one = ours.step(STATE, WISH | LIFTED, ON_THREE, activation=shares)
        fresh = solo(*[swing()] * first, *[other] * second)
        asked = WISH | (LIFTED if first else {})
        two = fresh.step(STATE, asked, ON_THREE)
        np.testing.assert_allclose(one.rotor_torque, two.rotor_torque, atol=1e-9)


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_activation_and_weights_are_those_of_a_controller_made_so(share):
    asked = WISH | LIFTED
    made = solo(swing(5.0 * share), posture=0.3).step(STATE, asked, ON_THREE)
    ours = solo(swing())
    blended = ours.step(
        STATE, asked, ON_THREE, activation={"swing": share}, weights={"posture": 0.3}
    )
    np.testing.assert_allclose(blended.acceleration, made.acceleration, atol=1e-5)
    back = ours.step(STATE, asked, ON_THREE)
    plain = solo(swing()).step(STATE, asked, ON_THREE)
    np.testing.assert_allclose(back.acceleration, plain.acceleration, atol=1e-5)


def test_a_task_switched_on_again_holds_what_it_finds():
    ours = solo(swing())
    ours.step(STATE, LIFTED, ON_THREE)
    ours.step(STATE, activation={"swing": 0.0})
    command = ours.step(STATE)
    assert command.status is Status.SOLVED
    np.testing.assert_allclose(command.acceleration, 0.0, atol=1e-3)


def test_the_time_step_of_a_tick_is_that_of_the_settings():
    """A joint near its stop at 250 Hz."""
    robot = load_robot("planar_leg_fixed")
    q, v, found = robot.neutral(), np.array([1.2, 1.2]), []
    limit = replace(JointLimit.of(robot), upper=q + 0.01)
    for made, asked in ((4e-3, None), (1e-3, 4e-3), (1e-3, None)):
        settings = ControllerSettings(time_step=made)
        ours = Controller(robot, [PostureTask.of(robot)], limits=[limit], settings=settings)
        command = ours.step(Motion(q, v), {"posture": Reference(q + 3.0)}, dt=asked)
        found.append(command.acceleration)
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)
    assert np.abs(found[2] - found[1]).max() > 1.0


def test_a_margin_keeps_a_gear_that_is_better_than_believed_from_slipping():
    """Least torque on an arm whose efficiencies are 5 % higher than the controller believes."""
    robot = load_robot("planar_leg_fixed")
    believed = with_wrong_efficiencies(robot, -0.05)
    plant, q = Plant(robot), robot.configuration(hip=2.6, knee=0.2)

    def moved(margin):
        settings = ControllerSettings(rest_policy=RestPolicy.LEAST_TORQUE, rest_margin=margin)
        ours = Controller(believed, [PostureTask.of(believed)], settings=settings)
        wish = {"posture": Reference(q)}
        run = simulate(plant, lambda s: ours.step(s, wish).rotor_torque, plant.state(q), 0.3)
        return np.abs(configuration(robot, run.log) - q).max()

    assert moved(0.0) > 1e-4
    assert moved(0.1) < 1e-6


@pytest.mark.parametrize(("share", "holds"), [(0.97, True), (1.03, False)])
def test_the_longest_step_is_where_a_default_task_stops_being_stable(share, holds):
    """Accelerations held over a step of exactly that length, on a plant without errors."""
    robot = arm(1, np.random.default_rng(0)).lossless()
    stiffness = (share / 0.05) ** 2
    ours = Controller(robot, [PostureTask.of(robot, stiffness=stiffness)], limits=[])
    assert np.isclose(LONGEST, 1.0 / np.sqrt(Task.stiffness))
    q, v, goal = np.array([0.01]), np.zeros(1), {"posture": Reference(np.zeros(1))}
    for _ in range(150):
        command = ours.step(Motion(q, v), goal, dt=0.05)
        assert command.status is Status.SOLVED
        q = q + 0.05 * v + 0.5 * 0.05**2 * command.acceleration
        v = v + 0.05 * command.acceleration
    assert abs(q[0]) < 1e-6 if holds else abs(q[0]) > 10.0


def test_joint_targets_are_one_step_of_the_command():
    v = 0.1 * np.random.default_rng(0).normal(size=18)
    for dt in (1e-3, 4e-3):
        command = solo().step(Motion(STAND, v), dt=dt)
        own = command.acceleration[6:]
        np.testing.assert_allclose(command.velocity, v[6:] + dt * own)
        place = STAND[7:] + dt * v[6:] + 0.5 * dt**2 * own
        np.testing.assert_allclose(command.position, place, atol=1e-15)


def test_a_tick_without_a_solution_asks_drives_to_stay():
    controller, nowhere = solo(), Motion(np.full(19, np.nan), np.zeros(18))
    assert np.isnan(controller.step(nowhere).position).all()
    controller.step(STATE)
    lost = controller.step(nowhere)
    np.testing.assert_array_equal(lost.position, STAND[7:])
    assert not lost.velocity.any()


def test_a_hook_makes_states_of_messages():
    joints = JointMap.of(SOLO, SOLO.transmission.joints[::-1])

    def estimated(message):
        motion = joints.motion(*message)
        motion.position[:7] = STAND[:7]
        return motion

    hooked = solo(state_hook=estimated)
    command = hooked.step((STAND[7:][::-1], np.zeros(12)))
    plain = solo().step(STATE)
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

    controller, found = solo(state_hook=slow), []
    good = controller.step(STATE)
    other = threading.Thread(target=lambda: found.append(controller.step(STATE)))
    other.start()
    assert inside.wait(10.0)
    refused = controller.step(STATE)
    go_on.set()
    other.join()
    assert refused.status is Status.BAD_INPUT
    assert "thread" in refused.message
    np.testing.assert_allclose(refused.rotor_torque, good.rotor_torque, atol=1e-12)
    assert found[0].status is Status.SOLVED
    assert controller.step(STATE).status is Status.SOLVED


def run(path: str, clutter: int) -> None:
    """Take ticks of Talos after `clutter` arrays on the heap; write states, commands, programs."""
    kept = [np.ones(size) for size in range(clutter)]
    talos = load_robot("talos")
    tasks = controller(talos, talos).tasks
    control = Controller(talos, tasks, feet(talos), settings=ControllerSettings(solver="daqp"))
    q, generator, ticks = talos.poses["half_sitting"], np.random.default_rng(0), []
    for _ in range(40):
        at = pin.integrate(talos.model, q, 0.01 * generator.normal(size=36))
        velocity = 0.05 * generator.normal(size=36)
        command = control.step(Motion(at, velocity))
        assert command.status.usable
        told = command.rotor_torque, command.acceleration, command.solution.x
        ticks.append(np.concatenate([at, velocity, *told]))
    assert len(kept) == clutter
    control.problem.save(f"{path}.npz")
    np.save(f"{path}.npy", ticks)


def test_talos_is_the_same_to_the_last_bit_in_two_processes(tmp_path):
    """With daqp: what ProxQP returns depends on where its memory happens to lie.

    The other process has another heap and another order of hashes.
    """
    here, there = str(tmp_path / "here"), str(tmp_path / "there")
    run(here, 0)
    code = f"from tests.control.test_loop_interface import run; run({there!r}, 60)"
    environment = os.environ | {"PYTHONHASHSEED": "60"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    np.testing.assert_array_equal(*(np.load(f"{path}.npy") for path in (here, there)))
    programs = (QPProblem.load(f"{path}.npz") for path in (here, there))
    for mine, its in zip(*programs, strict=True):
        np.testing.assert_array_equal(mine, its)
