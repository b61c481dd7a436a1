"""Targets far away: a task asks for its greatest acceleration, and no more, until it is there."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin
import pytest

from wbc.control import (
    CenterOfMassTask,
    Controller,
    FrameOrientationTask,
    JointLimit,
    PointContact,
    PostureTask,
    Reference,
    RotorTorqueLimit,
)
from wbc.effects import load_robot
from wbc.errors import ControlError
from wbc.robot import Motion
from wbc.sim import Plant


def test_a_target_a_metre_above_a_quadruped_refuses_no_tick():
    """It stretches its legs and stays there; without the limit 41 of these ticks had no motion."""
    robot = load_robot("solo12")
    q = np.array(robot.poses["standing"])
    target = np.array(pin.centerOfMass(robot.model, robot.model.createData(), q))
    target[2] += 1.0
    tasks = [
        CenterOfMassTask(weight=100.0),
        FrameOrientationTask(name="trunk", frame="base_link", weight=10.0),
        PostureTask.of(robot, weight=0.1, stiffness=50.0),
    ]
    feet = [PointContact(name=contact.name) for contact in robot.contacts]
    limits = [RotorTorqueLimit(), JointLimit.of(robot)]
    controller, plant, statuses = Controller(robot, tasks, feet, limits), Plant(robot), Counter()
    state = plant.state(q)
    for _ in range(1000):
        motion = Motion(state.position, state.velocity)
        command = controller.step(motion, {"center_of_mass": Reference(target)})
        statuses[command.status.usable] += 1
        state = plant.step(state, command.rotor_torque, 1e-3).state
    assert statuses == {True: 1000}
    assert state.position[2] > q[2] + 0.05


@pytest.mark.parametrize("limit", [2.0, 20.0])
def test_a_joint_goes_to_its_target_at_its_limit_and_does_not_pass_it(limit):
    """From rest it asks for its limit; then it goes at limit / damping, and comes to rest there."""
    robot = load_robot("planar_leg_fixed").lossless()
    task = PostureTask.of(robot, ("knee",), acceleration_limit=limit)
    rest = PostureTask.of(robot, ("hip",), name="hip", weight=10.0)
    controller = Controller(robot, [task, rest], limits=[])
    q, v, step, target = np.array([0.4, -1.0]), np.zeros(2), 1e-3, 1.0
    speeds, asked = [], []
    for _ in range(round(2.0 / (limit / 20.0) / step + 2.0 / step)):
        command = controller.step(Motion(q, v), {"posture": Reference(np.array([target]))})
        assert command.status.usable
        a = command.acceleration
        q, v = q + step * v + 0.5 * step**2 * a, v + step * a
        speeds.append(v[1])
        asked.append(a[1])
    assert asked[0] == pytest.approx(limit, rel=1e-3)
    assert np.abs(asked).max() <= limit * (1.0 + 1e-3)
    assert max(speeds) == pytest.approx(limit / 20.0, rel=0.02)
    assert q[1] == pytest.approx(target, abs=1e-3)


def test_a_task_far_too_fast_brakes_within_its_limit():
    robot = load_robot("planar_leg_fixed").lossless()
    controller = Controller(robot, [PostureTask.of(robot, acceleration_limit=100.0)], limits=[])
    state = Motion(np.array([0.4, -1.0]), np.array([50.0, -50.0]))
    command = controller.step(state)
    np.testing.assert_allclose(command.acceleration, [-100.0, 100.0], rtol=1e-3)


def test_an_acceleration_of_the_reference_is_not_limited():
    robot = load_robot("planar_leg_fixed").lossless()
    controller = Controller(robot, [PostureTask.of(robot, acceleration_limit=100.0)], limits=[])
    wanted = Reference(acceleration=np.array([500.0, -500.0]))
    command = controller.step(Motion(np.array([0.4, -1.0]), np.zeros(2)), {"posture": wanted})
    np.testing.assert_allclose(command.acceleration, [500.0, -500.0], rtol=1e-3)


def test_a_limit_is_positive():
    with pytest.raises(ControlError, match="acceleration_limit must be > 0"):
        CenterOfMassTask(acceleration_limit=0.0)
