"""Joints driven against their stops, in a plant whose motors are what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.control.scenes import CERTAIN
from wbc.control import (
    Controller,
    ControllerSettings,
    JointLimit,
    MotorBraking,
    PostureTask,
    Reference,
    RotorTorqueLimit,
)
from wbc.effects import load_robot
from wbc.robot import Motion

STOP, STEP = 0.9, 1e-3


def thrown_at_its_stop(braking, *, torque=0.5):
    """Return the fastest, farthest and refused ticks of a knee that is sent far beyond its stop."""
    robot = load_robot("planar_leg_fixed")
    robot = robot.with_transmission(robot.transmission.replace(torque_limit=[torque, torque]))
    limit = JointLimit.of(robot, ("knee",), acceleration=400.0, braking=braking)
    limit = replace(limit, lower=np.array([-2.0]), upper=np.array([STOP]), speed=np.array([30.0]))
    tasks = [PostureTask.of(robot, stiffness=400.0, weight=[1.0, 1.0])]
    control = Controller(
        robot,
        tasks,
        limits=[RotorTorqueLimit(), limit],
        settings=ControllerSettings(speed_blend=CERTAIN, time_step=STEP),
    )
    q, v = np.array([0.0, -1.0]), np.zeros(2)
    refused, top, far = 0, 0.0, -np.inf
    for _ in range(1200):
        command = control.step(Motion(q, v), {"posture": Reference(np.array([0.0, 3.0]))})
        refused += not command.status.usable
        a = command.acceleration
        q, v = q + STEP * v + 0.5 * STEP**2 * a, v + STEP * a
        top, far = max(top, v[1]), max(far, q[1])
        if refused:
            break
    return top, far, refused


def test_knee_stops_with_its_motors_own_torque():
    """As fast as the motor can brake, no faster: no tick without a solution, no stop overrun."""
    top, far, refused = thrown_at_its_stop(MotorBraking(share=0.8))
    assert refused == 0
    assert far <= STOP + 1e-6
    assert far > STOP - 0.05
    assert top > 1.0


def test_knee_that_counts_on_more_than_its_motor_has_passes_its_stop_braking():
    """It comes too fast; from there on it brakes with all that its motor has, tick by tick."""
    _, far, refused = thrown_at_its_stop(None)
    assert refused == 0
    assert STOP + 0.01 < far < STOP + 0.5


def test_losses_lengthen_no_way_to_a_stop():
    """Teeth help to brake: the lossy knee may come faster than one with perfect gears."""
    robot = load_robot("planar_leg_fixed")
    both = [JointLimit.of(r, braking=MotorBraking()).brakes for r in (robot, robot.lossless())]
    lossy, ideal = (brakes["torque"] / (1.0 + brakes["reflected"]) for brakes in both)
    assert np.all(lossy > ideal)


def test_a_joint_that_motors_share_stops_by_the_weakest_of_them():
    """D = [[1, 0], [-1, 1]]: the knee's torque passes both gears, so that the weaker one counts."""
    leg = load_robot("parallelogram_leg")
    gears = leg.transmission
    weak = leg.with_transmission(gears.replace(torque_limit=gears.torque_limit * [0.1, 1.0]))
    for robot in (leg, weak):
        held = MotorBraking().share * np.abs(gears.gear_ratio * robot.transmission.torque_limit)
        held = held / gears.backward_efficiency
        torque = JointLimit.of(robot).brakes["torque"]
        np.testing.assert_allclose(torque, [held[0], held.min()])


def test_limits_that_the_model_states_hold_by_default():
    """A knee that is sent beyond its stop stops there; told the torque limits alone it goes on."""
    robot, rest = load_robot("planar_leg_fixed"), np.zeros(2)
    stop = float(robot.model.upperPositionLimit[1])
    task, beyond = PostureTask.of(robot, stiffness=400.0), np.array([0.0, stop + 1.0])
    for limits, inside in ((None, True), ([RotorTorqueLimit()], False)):
        control = Controller(robot, [task], limits=limits)
        q, v = np.array([0.0, stop - 0.2]), rest
        for _ in range(1500):
            command = control.step(Motion(q, v), {"posture": Reference(beyond)})
            assert command.status.usable, command.message
            a = command.acceleration
            q, v = q + STEP * v + 0.5 * STEP**2 * a, v + STEP * a
        assert (q[1] <= stop + 1e-6) == inside
        assert q[1] > stop - 0.02
