"""Inverse dynamics of whole logs against single samples and forward dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.dynamics import (
    contact_torque,
    dissipative_equation,
    evaluate,
    inertial_parameters,
    inertial_regressor,
    link_torque,
    rotor_torque,
)
from wbc.effects import load_robot
from wbc.errors import DynamicsError, RobotError
from wbc.robot import Motion, Robot

NAMES = ["emps", "planar_leg", "parallelogram_leg", "differential_biped", "solo12"]
SAMPLES = 12


def random_motion(robot: Robot, seed: int, samples: int = SAMPLES) -> Motion:
    rng = np.random.default_rng(seed)
    q = np.array(
        [
            pin.integrate(robot.model, robot.neutral(), rng.normal(size=robot.model.nv))
            for _ in range(samples)
        ]
    )
    v, a = rng.normal(size=(2, samples, robot.model.nv))
    return Motion(q, v, a)


def with_friction(robot: Robot) -> Robot:
    one = np.ones(robot.transmission.size)
    return robot.with_transmission(
        robot.transmission.replace(
            rotor_coulomb_friction=0.02 * one, rotor_viscous_friction=1e-4 * one
        )
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_log_is_its_samples(name: str) -> None:
    robot = with_friction(load_robot(name))
    motion = random_motion(robot, 1)
    links = link_torque(robot, motion)
    torque, rest = rotor_torque(robot, motion, links)
    for i in range(SAMPLES):
        terms = evaluate(robot, motion.position[i], motion.velocity[i])
        np.testing.assert_allclose(
            links[i], terms.mass_matrix @ motion.acceleration[i] + terms.bias, atol=1e-9
        )
        single = Motion(motion.position[i], motion.velocity[i], motion.acceleration[i])
        one, left = rotor_torque(robot, single, links[i])
        np.testing.assert_allclose(torque[i], one, atol=1e-12)
        np.testing.assert_allclose(rest[i], left, atol=1e-12)


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg"])
def test_inverse_undoes_forward_dynamics(name: str) -> None:
    robot = load_robot(name)
    motion = random_motion(robot, 2, 40)
    links = link_torque(robot, motion)
    torque, rest = rotor_torque(robot, motion, links)
    gears, seen = robot.transmission, set()
    for i in range(40):
        speed = gears.motor_from_joint @ motion.velocity[i][robot.actuated]
        output = gears.topology.T @ links[i][robot.actuated]
        mode = np.sign(output * speed)
        seen.add(tuple(mode))
        terms = evaluate(robot, motion.position[i], motion.velocity[i])
        external = np.zeros(robot.model.nv)
        external[robot.unactuated] = rest[i]
        found = dissipative_equation(robot, terms, mode).acceleration(torque[i], external)
        np.testing.assert_allclose(found, motion.acceleration[i], rtol=1e-8, atol=1e-8)
    assert len(seen) == 4


@pytest.mark.parametrize("name", ["planar_leg", "solo12"])
def test_the_regressor_times_the_parameters_is_the_torque(name: str) -> None:
    robot = load_robot(name)
    motion = random_motion(robot, 4)
    product = inertial_regressor(robot, motion) @ inertial_parameters(robot)
    np.testing.assert_allclose(product, link_torque(robot, motion), atol=1e-9)
    # Another parameter vector gives the torque of the robot that has it.
    last, load = (
        robot.model.njoints - 1,
        pin.Inertia(0.5, np.array([0.1, 0.0, -0.2]), 1e-3 * np.eye(3)),
    )
    heavier = robot.with_inertia(last, robot.model.inertias[last] + load)
    product = inertial_regressor(robot, motion) @ inertial_parameters(heavier)
    np.testing.assert_allclose(product, link_torque(heavier, motion), atol=1e-9)


def test_contact_forces_do_the_work_of_the_moving_contact() -> None:
    robot = load_robot("differential_biped")
    motion = random_motion(robot, 5, 3)
    rng = np.random.default_rng(6)
    forces = {"left_toe": rng.normal(size=(3, 3)), "right_heel": rng.normal(size=(3, 3))}
    torque = contact_torque(robot, motion.position, forces)
    names = [contact.name for contact in robot.contacts]
    for i in range(3):
        terms = evaluate(robot, motion.position[i], motion.velocity[i])
        speed = (terms.contact_jacobian @ motion.velocity[i]).reshape(-1, 3)
        work = sum(float(f[i] @ speed[names.index(n)]) for n, f in forces.items())
        assert torque[i] @ motion.velocity[i] == pytest.approx(work)
    with pytest.raises(RobotError, match="left_toe"):
        contact_torque(robot, motion.position, {"toe": np.zeros((3, 3))})
    np.testing.assert_array_equal(contact_torque(robot, motion.position, {}), 0.0)


def test_a_measured_contact_force_carries_its_part_of_the_load() -> None:
    robot = load_robot("planar_leg").lossless()
    q = robot.pose("paper")
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    still = Motion(q[None], np.zeros((1, 5)), np.zeros((1, 5)))
    force = contact_torque(robot, still.position, {"foot": np.array([[0.0, 0.0, weight]])})
    torque, rest = rotor_torque(robot, still, link_torque(robot, still), force)
    # The foot is straight under the hip. Both links' centres lie 0.1 m ahead of it, the shin's
    # centre 0.1 m behind the knee, the foot 0.2 m behind the knee.
    links = 4.0 * 9.81 * 0.1
    np.testing.assert_allclose(rest[0], [0.0, 0.0, -links], atol=1e-9)
    knee = 2.0 * 9.81 * 0.1 - weight * 0.2
    np.testing.assert_allclose(20.0 * torque[0], [-links, knee], atol=1e-9)


def test_accelerations_are_needed() -> None:
    robot = load_robot("planar_leg_fixed")
    with pytest.raises(DynamicsError, match="accelerations"):
        link_torque(robot, Motion(np.zeros((2, 2)), np.zeros((2, 2))))
