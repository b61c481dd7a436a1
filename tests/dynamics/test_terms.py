"""Evaluated terms against MuJoCo and finite differences."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from tests.reference.mujoco_leg import leg_model
from wbc.dynamics import Workspace, dissipative_equation, evaluate
from wbc.effects import load_robot

NAMES = ["planar_leg", "differential_biped", "solo12"]


@pytest.mark.parametrize("name", NAMES)
def test_contact_jacobian_and_drift_are_derivatives_of_the_contact_position(
    name: str, random_state
) -> None:
    robot = load_robot(name)
    q, v = random_state(robot, 1)
    space = Workspace(robot)
    step = 1e-6
    here = evaluate(robot, q, v, space)
    ahead = evaluate(robot, pin.integrate(robot.model, q, step * v), v, space)
    behind = evaluate(robot, pin.integrate(robot.model, q, -step * v), v, space)
    moved = (ahead.contact_position - behind.contact_position).ravel() / (2 * step)
    np.testing.assert_allclose(here.contact_jacobian @ v, moved, atol=1e-7)
    turned = (ahead.contact_jacobian - behind.contact_jacobian) @ v / (2 * step)
    np.testing.assert_allclose(here.contact_drift, turned, atol=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_the_links_power_is_the_rate_of_their_energy(name: str, random_state) -> None:
    robot = load_robot(name)
    q, v = random_state(robot, 2)
    a = np.random.default_rng(3).normal(size=robot.model.nv)
    terms = evaluate(robot, q, v)
    step, data = 1e-6, robot.model.createData()

    def energy(h: float) -> float:
        there = pin.integrate(robot.model, q, h * v + 0.5 * h * h * a)
        return float(pin.computeMechanicalEnergy(robot.model, data, there, v + h * a))

    rate = (energy(step) - energy(-step)) / (2 * step)
    assert v @ (terms.mass_matrix @ a + terms.bias) == pytest.approx(rate, rel=1e-5, abs=1e-5)
    np.testing.assert_array_equal(terms.mass_matrix, terms.mass_matrix.T)


def test_lossless_accelerations_are_those_of_mujoco_with_armature(random_state) -> None:
    robot = load_robot("planar_leg")
    gears = robot.transmission
    model = leg_model(armature=gears.reflected_inertia[0], ground=False)
    q, v = random_state(robot, 4)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    torque = np.array([0.4, -0.2])
    data.ctrl[:] = gears.gear_ratio * torque
    mujoco.mj_forward(model, data)
    equation = dissipative_equation(robot, evaluate(robot, q, v), np.zeros(2))
    ours = equation.acceleration(torque, np.zeros(robot.model.nv))
    np.testing.assert_allclose(ours, data.qacc, rtol=1e-9, atol=1e-9)


def test_evaluating_does_not_change_the_robot(random_state) -> None:
    robot = load_robot("differential_biped")
    frames = robot.model.nframes
    q, v = random_state(robot, 5)
    first = evaluate(robot, q, v)
    again = evaluate(robot, q, v)
    assert robot.model.nframes == frames
    np.testing.assert_array_equal(first.bias, again.bias)
    np.testing.assert_array_equal(first.contact_jacobian, again.contact_jacobian)


@pytest.mark.parametrize("name", NAMES)
def test_the_center_of_mass_outlives_the_terms_it_came_from(name: str, random_state) -> None:
    robot = load_robot(name)
    for seed in range(5):
        q, v = random_state(robot, seed)
        found = evaluate(robot, q, v).center_of_mass
        for _ in range(3):
            evaluate(robot, robot.neutral(), v)  # writes where the first terms had their memory
        data = robot.model.createData()
        assert np.allclose(found, pin.centerOfMass(robot.model, data, q), atol=1e-12)
