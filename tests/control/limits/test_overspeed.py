"""Joints that no motor can stop in time: they brake with all there is, and the tick says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.control.scenes import CERTAIN
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    JointLimit,
    PointContact,
    PostureTask,
    RotorTorqueLimit,
    Status,
)
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.sim import Plane, Plant

SPEED, WAY = 10.0, 0.3


def at_their_stops(robot, q, *, joints=None, acceleration=1000.0):
    """Return joint limits with stops at WAY to both sides of q, and the joints' places in q."""
    limit = JointLimit.of(robot, joints, acceleration=acceleration)
    at = q[limit.position_rows]
    return replace(limit, lower=at - WAY, upper=at + WAY)


def overspeed(robot, q, limit, joint, sign):
    """Return the state of a robot whose joint is at its stop and moves out of it."""
    x, v = q.copy(), np.zeros(robot.model.nv)
    x[limit.position_rows[joint]] += sign * WAY
    v[limit.rows[joint]] = sign * SPEED
    return Motion(x, v)


@pytest.mark.parametrize("name", ["solo12", "anymal"])
@pytest.mark.parametrize("acceleration", [100.0, 1000.0])
def test_a_joint_that_leaves_its_stop_brakes_and_the_tick_is_solved(name, acceleration):
    robot = load_robot(name)
    q = next(iter(robot.poses.values()))
    limit = at_their_stops(robot, q, acceleration=acceleration)
    feet = [PointContact(name=contact.name) for contact in robot.contacts]
    tasks = [CenterOfMassTask(weight=100.0), PostureTask.of(robot, weight=0.1)]
    controller = Controller(robot, tasks, feet, [RotorTorqueLimit(), limit])
    passed = 0
    for joint, name in enumerate(limit.joints):
        for sign in (1.0, -1.0):
            command = controller.step(overspeed(robot, q, limit, joint, sign))
            assert command.status is Status.SOLVED, (name, sign, command.message)
            a = sign * command.acceleration[limit.rows[joint]]
            own = f"joint limit of '{name}'"
            missing = command.passed.get(own, 0.0)
            assert abs(a + acceleration) == pytest.approx(missing, abs=0.02 * acceleration)
            if missing > 0.02 * acceleration:
                assert "leaves no more" in command.message
                passed += 1
            assert np.all(
                np.abs(command.rotor_torque) <= robot.transmission.torque_limit * (1.0 + 1e-9)
            )
            for force in command.forces.values():
                assert force[2] >= -1e-5
                assert np.abs(force[:2]).max() <= 0.7 * force[2] + 1e-4
    assert passed > 0


def test_the_braking_is_the_greatest_that_the_motor_has():
    """Of a joint alone that is its own torque limit, as the plant moves with it."""
    robot = load_robot("planar_leg_fixed")
    q = np.array([0.4, -1.0])
    limit = at_their_stops(robot, q, joints=("knee",), acceleration=1e5)
    controller = Controller(
        robot,
        [PostureTask.of(robot)],
        limits=[RotorTorqueLimit(), limit],
        settings=ControllerSettings(speed_blend=CERTAIN),
    )
    state = overspeed(robot, q, limit, 0, 1.0)
    state = Motion(state.position, np.array([0.5, state.velocity[1]]))
    command = controller.step(state)
    assert command.status is Status.SOLVED
    knee = robot.transmission.torque_limit[1]
    assert command.rotor_torque[1] == pytest.approx(-knee, rel=1e-6)
    plant, step = Plant(robot, Plane(height=-5.0)), 1e-6
    start = plant.state(state.position, state.velocity)
    after = plant.step(start, command.rotor_torque, step).state
    moved = (after.velocity - state.velocity) / step
    np.testing.assert_allclose(moved, command.acceleration, rtol=1e-3)
    assert set(command.passed) == {"joint limit of 'knee'"}
    asked = limit.bounds(state.position, state.velocity, 1e-3)[1]
    assert command.passed["joint limit of 'knee'"] == pytest.approx(moved[1] - asked[0], rel=1e-4)


def test_a_task_of_infinite_weight_gives_way_before_a_limit():
    robot = load_robot("planar_leg_fixed")
    limit = JointLimit.of(robot, acceleration=30.0)
    task = PostureTask.of(robot, weight=np.inf, stiffness=400.0)
    controller = Controller(robot, [task], limits=[RotorTorqueLimit(), limit])
    q = np.array([0.4, -1.0])
    controller.step(Motion(q, np.zeros(2)))
    command = controller.step(Motion(q + np.array([0.5, 0.0]), np.zeros(2)))
    assert command.status is Status.SOLVED
    assert command.acceleration[0] == pytest.approx(-30.0, rel=0.02)
    assert "task 'posture'" in command.message
    assert "joint limit of 'hip'" in command.message
