"""Weights, activation and time step by tick; the margin inside the interval of stiction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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
from wbc.control.rows.task import Task
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.sim import Plant

SOLO = load_robot("solo12")
STATE = still(SOLO)
FEET = [contact.name for contact in SOLO.contacts]


def controller_of(more=(), **weights):
    tasks = [
        CenterOfMassTask(weight=weights.get("com", 10.0)),
        PostureTask.of(SOLO, weight=weights.get("posture", 0.1)),
        *more,
    ]
    return Controller(SOLO, tasks, points(SOLO))


def swing(weight=5.0):
    return FramePositionTask(name="swing", frame=SOLO.contact(FEET[0]).frame, weight=weight)


WISH = {"center_of_mass": Reference(np.array([0.01, 0.0, 0.2]))}
LIFTED = {"swing": Reference(np.array([0.2, 0.15, 0.1]))}


def test_tasks_go_on_and_off_from_tick_to_tick():
    """Rows of two tasks come and go in every order; the motion is that of a fresh controller."""
    other = FramePositionTask(name="other", frame=SOLO.contact(FEET[1]).frame, weight=5.0)
    ours = controller_of([swing(), other])
    stance = dict.fromkeys(FEET[1:], np.inf)
    orders = [(0, 1), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1), (0, 0), (1, 0), (0, 1)]
    for first, second in orders:
        shares = {"swing": float(first), "other": float(second)}
        ours.reset()
        one = ours.step(STATE, WISH | LIFTED, stance, activation=shares)
        fresh = controller_of([swing()] * first + [other] * second)
        asked = WISH | (LIFTED if first else {})
        two = fresh.step(STATE, asked, stance)
        np.testing.assert_allclose(one.rotor_torque, two.rotor_torque, atol=1e-9)


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_activation_and_weights_are_those_of_a_controller_made_so(share):
    stance = dict.fromkeys(FEET[1:], np.inf)
    asked = WISH | LIFTED
    made = controller_of([swing(5.0 * share)], posture=0.3).step(STATE, asked, stance)
    ours = controller_of([swing()])
    blended = ours.step(STATE, asked, stance, activation={"swing": share}, weights={"posture": 0.3})
    np.testing.assert_allclose(blended.acceleration, made.acceleration, atol=1e-5)
    back = ours.step(STATE, asked, stance)
    plain = controller_of([swing()]).step(STATE, asked, stance)
    np.testing.assert_allclose(back.acceleration, plain.acceleration, atol=1e-5)


def test_a_task_switched_on_again_holds_what_it_finds():
    ours = controller_of([swing()])
    ours.step(STATE, LIFTED, dict.fromkeys(FEET[1:], np.inf))
    ours.step(STATE, activation={"swing": 0.0})
    command = ours.step(STATE)
    assert command.status is Status.SOLVED
    np.testing.assert_allclose(command.acceleration, 0.0, atol=1e-3)


def test_the_time_step_of_a_tick_is_that_of_the_settings():
    """A joint near its stop at 250 Hz."""
    robot = load_robot("planar_leg_fixed")
    q, v = robot.neutral(), np.array([1.2, 1.2])
    limit = replace(JointLimit.of(robot), upper=q + 0.01)
    slow = ControllerSettings(time_step=4e-3)
    made = Controller(robot, [PostureTask.of(robot)], limits=[limit], settings=slow)
    ours = Controller(robot, [PostureTask.of(robot)], limits=[limit])
    one = ours.step(Motion(q, v), {"posture": Reference(q + 3.0)}, dt=4e-3)
    two = made.step(Motion(q, v), {"posture": Reference(q + 3.0)})
    np.testing.assert_allclose(one.acceleration, two.acceleration, atol=1e-6)
    plain = Controller(robot, [PostureTask.of(robot)], limits=[limit])
    three = plain.step(Motion(q, v), {"posture": Reference(q + 3.0)})
    assert np.abs(three.acceleration - two.acceleration).max() > 1.0


def test_a_margin_keeps_a_gear_that_is_better_than_believed_from_slipping():
    """Least torque on an arm whose efficiencies are 5 % higher than the controller believes."""
    robot = load_robot("planar_leg_fixed")
    gears = robot.transmission
    believed = robot.with_transmission(
        gears.replace(
            forward_efficiency=0.95 * gears.forward_efficiency,
            backward_efficiency=0.95 * gears.backward_efficiency,
        )
    )
    q, moved = robot.configuration(hip=2.6, knee=0.2), {}
    for margin in (0.0, 0.1):
        settings = ControllerSettings(rest_policy=RestPolicy.LEAST_TORQUE, rest_margin=margin)
        ours = Controller(believed, [PostureTask.of(believed)], settings=settings)
        plant = Plant(robot)
        state, worst = plant.state(q), 0.0
        for _ in range(300):
            command = ours.step(state, {"posture": Reference(q)})
            state = plant.step(state, command.rotor_torque, 1e-3).state
            worst = max(worst, float(np.abs(state.position - q).max()))
        moved[margin] = worst
    assert moved[0.0] > 1e-4
    assert moved[0.1] < 1e-6


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
