"""Joints driven against their stops and beyond, in a plant whose motors are what they are."""

from dataclasses import replace

import numpy as np
import pytest

from tests.control.scenes import CERTAIN, points, usual
from tests.sim.random_robots import geared
from wbc.control import (
    Controller,
    ControllerSettings,
    JointLimit,
    PostureTask,
    Reference,
    RotorTorqueLimit,
    Status,
)
from wbc.control.rows.motion_rows import viable
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.sim import Plane, Plant

ARM, STEP = load_robot("planar_leg_fixed"), 1e-3
CERTAINLY = ControllerSettings(speed_blend=CERTAIN, time_step=STEP)


def driven_beyond(robot, limits, stop, start, beyond, ticks, settings=None):
    """Send a knee far beyond its stop; return how fast it came, how far behind it got and ends."""
    task = PostureTask.of(robot, stiffness=400.0)
    control = Controller(robot, [task], limits=limits, settings=settings)
    q, v, top, far = np.array([0.0, start]), np.zeros(2), 0.0, -np.inf
    for _ in range(ticks):
        command = control.step(Motion(q, v), {"posture": Reference(np.array([0.0, beyond]))})
        assert command.status.usable, command.message
        a = command.acceleration
        q, v = q + STEP * v + 0.5 * STEP**2 * a, v + STEP * a
        top, far = max(top, v[1]), max(far, q[1] - stop)
    return top, far, q[1] - stop


@pytest.mark.parametrize("knows", [True, False])
def test_a_knee_stops_with_its_motors_own_torque(knows):
    """As fast as the motor can brake, no faster: no tick without a solution, no stop overrun.

    Counting on more than its motor has it comes too fast, and brakes with all there is from there.
    """
    robot = geared(ARM, torque_limit=0.5)
    braking = 0.8 if knows else None
    limit = JointLimit.of(robot, ("knee",), acceleration=400.0, braking=braking)
    limit = replace(limit, lower=np.array([-2.0]), upper=np.array([0.9]), speed=np.array([30.0]))
    top, far, _ = driven_beyond(robot, [RotorTorqueLimit(), limit], 0.9, -1.0, 3.0, 1200, CERTAINLY)
    assert top > 1.0
    assert -0.05 < far <= 1e-6 if knows else 0.01 < far < 0.5


def test_limits_that_the_model_states_hold_by_default():
    """A knee that is sent beyond its stop stops there; told the torque limits alone it goes on."""
    stop, torques = float(ARM.model.upperPositionLimit[1]), RotorTorqueLimit()
    left_out, short, stated, alone = (
        driven_beyond(ARM, limits, stop, stop - 0.2, stop + 1.0, 1500)
        for limits in (None, [torques, JointLimit()], [torques, JointLimit.of(ARM)], [torques])
    )
    assert left_out == short == stated
    assert -0.02 < left_out[2] <= 1e-6 < alone[2]


def test_braking_is_what_the_gears_allow():
    """M b = |T| + c with eta_b |T| + N^2 I_r b = share U, from the numbers of the gears."""
    solo = load_robot("solo12")
    gears = solo.transmission
    load, inertia = np.linspace(-0.5, 0.5, 12), np.full(12, 0.01)
    brakes = JointLimit.of(solo, braking=0.9)
    limit = 0.9 * gears.gear_ratio * gears.torque_limit
    for way in (1.0, -1.0):
        b = (brakes.torque + way * load) / (inertia + brakes.reflected)
        spent = gears.backward_efficiency * (inertia * b - way * load) + gears.reflected_inertia * b
        np.testing.assert_allclose(spent, limit, rtol=1e-12)


def test_a_joint_that_motors_share_stops_by_the_weakest_of_them():
    """D = [[1, 0], [-1, 1]]: the knee's torque passes both gears, so that the weaker one counts."""
    leg = load_robot("parallelogram_leg")
    gears = leg.transmission
    for share in ([1.0, 1.0], [0.1, 1.0]):
        limit = gears.torque_limit * share
        held = 0.8 * np.abs(gears.gear_ratio * limit) / gears.backward_efficiency
        torque = JointLimit.of(geared(leg, torque_limit=limit)).torque
        np.testing.assert_allclose(torque, [held[0], held.min()])


SPEED, WAY = 10.0, 0.3


def at_their_stops(robot, q, *, joints=None, acceleration=1000.0):
    """Return joint limits with stops at WAY to both sides of q, and the joints' places in q."""
    limit = JointLimit.of(robot, joints, acceleration=acceleration)
    at = q[limit.position_rows]
    return replace(limit, lower=at - WAY, upper=at + WAY)


@pytest.mark.parametrize("name", ["solo12", "anymal"])
@pytest.mark.parametrize("acceleration", [100.0, 1000.0])
def test_a_joint_that_leaves_its_stop_brakes_and_the_tick_is_solved(name, acceleration):
    robot = load_robot(name)
    limit = at_their_stops(robot, robot.pose(), acceleration=acceleration)
    controller = Controller(robot, usual(robot), points(robot), [RotorTorqueLimit(), limit])
    passed = 0
    for joint, name in enumerate(limit.joints):
        for sign in (1.0, -1.0):
            q, v = robot.pose(), np.zeros(robot.model.nv)
            q[limit.position_rows[joint]] += sign * WAY
            v[limit.rows[joint]] = sign * SPEED
            command = controller.step(Motion(q, v))
            assert command.status is Status.SOLVED, (name, sign, command.message)
            a = sign * command.acceleration[limit.rows[joint]]
            missing = command.passed.get(f"joint limit of '{name}'", 0.0)
            assert abs(a + acceleration) == pytest.approx(missing, abs=0.02 * acceleration)
            if missing > 0.02 * acceleration:
                assert "leaves no more" in command.message
                passed += 1
            torque_limit = robot.transmission.torque_limit * (1.0 + 1e-9)
            assert np.all(np.abs(command.rotor_torque) <= torque_limit)
            for force in command.forces.values():
                assert force[2] >= -1e-5
                assert np.abs(force[:2]).max() <= 0.7 * force[2] + 1e-4
    assert passed > 0


def test_the_braking_is_the_greatest_that_the_motor_has():
    """Of a joint alone that is its own torque limit, as the plant moves with it."""
    q = np.array([0.4, -1.0])
    limit = at_their_stops(ARM, q, joints=("knee",), acceleration=1e5)
    limits = [RotorTorqueLimit(), limit]
    controller = Controller(ARM, [PostureTask.of(ARM)], limits=limits, settings=CERTAINLY)
    state = Motion(np.array([0.4, -1.0 + WAY]), np.array([0.5, SPEED]))
    command = controller.step(state)
    assert command.status is Status.SOLVED
    knee = ARM.transmission.torque_limit[1]
    assert command.rotor_torque[1] == pytest.approx(-knee, rel=1e-6)
    plant, step = Plant(ARM, Plane(height=-5.0)), 1e-6
    start = plant.state(state.position, state.velocity)
    after = plant.step(start, command.rotor_torque, step).state.velocity
    moved = (after - state.velocity) / step
    np.testing.assert_allclose(moved, command.acceleration, rtol=1e-3)
    assert set(command.passed) == {"joint limit of 'knee'"}
    room = limit.upper[0] - state.position[1]
    asked = viable(room, state.velocity[1], limit.acceleration[0], STEP)
    assert command.passed["joint limit of 'knee'"] == pytest.approx(moved[1] - asked, rel=1e-4)
