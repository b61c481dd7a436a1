"""The command of a tick without a solution holds the robot, takes energy, and lets it down."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.control.scenes import points
from wbc.control import (
    Controller,
    ControllerSettings,
    LetDown,
    PostureTask,
    Reference,
)
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.robot.library import robot_names
from wbc.sim import Plant

DT = 1e-3
LONG = LetDown(hold=100.0)


def standing(robot):
    return robot.pose() if robot.poses else robot.neutral()


def controller_of(robot, policy, *, feet=True):
    settings = ControllerSettings(safety=policy)
    contacts = points(robot) if feet else []
    return Controller(robot, [PostureTask.of(robot)], contacts, settings=settings)


def kinetic(robot, q, v):
    """Return the energy of links and rotors [J], for a floating base that beside the fall."""
    data = robot.model.createData()
    mass = pin.crba(robot.model, data, q)
    gears = robot.transmission
    turning = gears.motor_from_joint @ v[robot.actuated]
    energy = 0.5 * (v @ mass @ v + turning @ (gears.reflected_inertia * turning))
    if robot.floating_size:
        pin.centerOfMass(robot.model, data, q, v)
        energy -= 0.5 * pin.computeTotalMass(robot.model) * (data.vcom[0] @ data.vcom[0])
    return energy


def free_motion(robot, q, v, torque):
    """Return v after a tick without losses, contacts or limits: M dv = dt (B torque - bias)."""
    model, data = robot.model, robot.model.createData()
    mass = pin.crba(model, data, q)
    gears, m = robot.transmission, robot.actuated
    reflected = gears.motor_from_joint.T * gears.reflected_inertia @ gears.motor_from_joint
    mass[np.ix_(m, m)] += reflected
    force = -pin.nonLinearEffects(model, data, q, v)
    force[m] += gears.motor_from_joint.T @ (gears.gear_ratio * torque)
    return v + DT * np.linalg.solve(mass, force)


@pytest.mark.parametrize("name", robot_names())
def test_safe_torque_takes_energy_on_every_shipped_robot(name):
    """On ideal gears, which take none themselves, and without limits, from random speeds.

    A floating base falls freely: what counts is the motion beside the fall.
    """
    robot = load_robot(name).lossless()
    if robot.floating_size not in (0, 3, 6):
        pytest.skip("it hangs on a joint without a drive, at which gravity does work")
    m = robot.transmission.size
    robot = robot.with_transmission(robot.transmission.replace(torque_limit=np.full(m, 1e9)))
    generator = np.random.default_rng(0)
    for _ in range(2):
        controller = controller_of(robot, LONG, feet=False)
        q, v = standing(robot), np.zeros(robot.model.nv)
        v[robot.actuated] = generator.normal(size=m)
        before = kinetic(robot, q, v)
        for _ in range(100):
            command = controller.step(Motion(q, v), contacts={"nowhere": 0.0})
            assert not command.status.usable
            v = free_motion(robot, q, v, command.rotor_torque)
            q = pin.integrate(robot.model, q, DT * v)
            after = kinetic(robot, q, v)
            assert after <= before * (1.0 + 1e-3) + 1e-9
            before = after
        assert np.abs(v[robot.actuated]).max() < 0.2


@pytest.mark.parametrize("name", ["solo12", "anymal", "talos", "planar_leg_strong", "tiago"])
def test_safe_torque_does_not_hammer(name):
    """No joint's torque jumps by more than its limit from one tick to the next."""
    robot = load_robot(name).lossless()
    policy, generator = LetDown(ride_through=0), np.random.default_rng(1)
    controller = controller_of(robot, policy, feet=False)
    q, v = standing(robot), np.zeros(robot.model.nv)
    v[robot.actuated] = 0.3 * generator.normal(size=robot.transmission.size)
    torques = []
    for _ in range(100):
        command = controller.step(Motion(q, v), contacts={"nowhere": 0.0})
        torques.append(command.rotor_torque)
        v = free_motion(robot, q, v, command.rotor_torque)
        q = pin.integrate(robot.model, q, DT * v)
    jumps = np.abs(np.diff(torques, axis=0)) / robot.transmission.torque_limit
    assert (jumps > 1.0).sum() == 0


def test_a_wrong_reference_does_not_drop_the_hand():
    """An arm that gets a target of the wrong shape stays up for a second, then sinks slowly."""
    robot = load_robot("planar_leg_fixed")
    controller = Controller(robot, [PostureTask.of(robot)])
    plant = Plant(robot)
    q = robot.configuration(hip=np.pi / 2.0, knee=0.3)
    state, heights = plant.state(q), []
    for tick in range(4000):
        wish = {"posture": Reference(q if tick < 50 else np.zeros(7))}
        command = controller.step(state, wish)
        assert command.status.usable is (tick < 50)
        state = plant.step(state, command.rotor_torque, DT).state
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, state.position)
        heights.append(data.oMf[robot.model.getFrameId("foot")].translation[2])
    heights = np.array(heights)
    assert np.abs(heights[:1000] - heights[0]).max() < 0.01
    assert heights[-1] < heights[0] - 0.05
    assert np.abs(np.diff(heights)).max() < 0.5 * DT


def test_a_standing_robot_stays_up_and_is_let_down():
    robot = load_robot("solo12")
    controller = controller_of(robot, LetDown(hold=0.2, lowering=0.5))
    plant = Plant(robot)
    state = plant.state(standing(robot))
    heights, speeds = [], []
    for tick in range(900):
        wrong = {} if tick < 20 else {"postur": None}
        command = controller.step(state, wrong)
        state = plant.step(state, command.rotor_torque, DT).state
        heights.append(state.position[2])
        speeds.append(abs(state.velocity[2]))
    assert abs(heights[219] - heights[19]) < 0.01
    assert heights[-1] < heights[0] - 0.02
    assert max(speeds) < 0.7


def test_a_few_bad_ticks_are_ridden_through():
    robot = load_robot("solo12")
    controller = controller_of(robot, LetDown(ride_through=3))
    state = Motion(standing(robot), np.zeros(robot.model.nv))
    good = controller.step(state).rotor_torque
    moving = Motion(state.position, np.full(robot.model.nv, 0.1))
    for _ in range(3):
        command = controller.step(moving, {"postur": None})
        np.testing.assert_allclose(command.rotor_torque, good, atol=1e-12)
    assert np.abs(controller.step(moving, {"postur": None}).rotor_torque - good).max() > 1e-6
    controller.step(state)
    np.testing.assert_allclose(controller.step(None).rotor_torque, good, atol=1e-6)
