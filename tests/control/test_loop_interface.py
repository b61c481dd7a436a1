"""What a loop around the controller needs: joint targets, a state hook, threads, schedules."""

from __future__ import annotations

import threading

import numpy as np

from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PostureTask,
    Status,
)
from wbc.effects import load_robot
from wbc.robot import JointMap, Motion

SOLO = load_robot("solo12")
STAND = next(iter(SOLO.poses.values()))


def solo(**settings):
    return Controller(
        SOLO,
        [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=0.1)],
        [PointContact(name=c.name) for c in SOLO.contacts],
        settings=ControllerSettings(**settings),
    )


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
    controller.step(Motion(STAND, np.zeros(18)))
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
    plain = solo().step(Motion(STAND, np.zeros(18)))
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
    still = Motion(STAND, np.zeros(18))
    good = controller.step(still)
    found = []
    other = threading.Thread(target=lambda: found.append(controller.step(still)))
    other.start()
    assert inside.wait(10.0)
    refused = controller.step(still)
    go_on.set()
    other.join()
    assert refused.status is Status.BAD_INPUT
    assert "thread" in refused.message
    np.testing.assert_allclose(refused.rotor_torque, good.rotor_torque, atol=1e-12)
    assert found[0].status is Status.SOLVED
    assert controller.step(still).status is Status.SOLVED
