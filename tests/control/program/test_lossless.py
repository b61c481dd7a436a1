"""A robot without losses gets the classical controller, written down again and solved twice."""

from __future__ import annotations

import numpy as np
import pytest

from tests.control.program.independent import force_cost, solve_in_directions
from tests.control.scenes import leg_controller, leg_references, leg_rows, random_state
from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.robot import Motion

WEIGHT = 19.0 * 9.81


@pytest.mark.parametrize("name", ["planar_leg_strong", "parallelogram_leg"])
def test_lossless_robot_gets_the_classical_torques(name):
    """Dense program in (qdd, f, tau) with the classical equation of motion, solved by daqp."""
    robot = load_robot(name).lossless()
    controller = leg_controller(robot)
    generator = np.random.default_rng(3)
    compared = 0
    for _ in range(40):
        q, v = random_state(robot, generator)
        com, posture = 0.2 * generator.normal(size=2), generator.normal(size=2)
        command = controller.step(Motion(q, v), leg_references(com, posture))
        task = leg_rows(robot, evaluate(robot, q, v), com, posture)
        found = solve_in_directions(
            robot,
            q,
            v,
            np.zeros(2),
            task,
            [0, 2],
            force_share=np.array([0.0, WEIGHT]),
            guarded=False,
        )
        assert command.status.usable is (found is not None), command.message
        if found is None:
            continue
        _, acceleration, force, torque = found
        scale = 1.0 + np.abs(acceleration).max()
        np.testing.assert_allclose(command.acceleration, acceleration, atol=1e-4 * scale)
        np.testing.assert_allclose(command.rotor_torque, torque, atol=1e-4 * scale)
        np.testing.assert_allclose(command.forces["foot"][[0, 2]], force, atol=1e-3 * scale)
        compared += 1
    assert compared > 15


def test_unbounded_solution_is_that_of_the_linear_system():
    """Without active inequalities the program is a linear system; solved here by numpy."""
    robot = load_robot("planar_leg_strong").lossless()
    robot = robot.with_transmission(robot.transmission.replace(torque_limit=[1e6, 1e6]))
    q = robot.configuration(hip=-0.4, knee=0.8, base_z=0.7)
    v = np.array([0.0, 0.05, 0.1, -0.1, 0.2])
    terms = evaluate(robot, q, v)
    com, posture = np.array([0.02, 0.65]), np.array([-0.4, 0.8])
    command = leg_controller(robot).step(Motion(q, v), leg_references(com, posture))
    rows, target = leg_rows(robot, terms, com, posture)
    gears = robot.transmission
    mass = terms.mass_matrix.copy()
    mass[robot.actuated, robot.actuated] += gears.reflected_inertia
    J = terms.contact_jacobian[[0, 2]]
    drift = terms.contact_drift[[0, 2]] + 10.0 * (J @ v)
    k = np.zeros((5 + 2 + 3 + 2, 5 + 2 + 3 + 2))
    # Unknowns qdd (5), f (2), multipliers of the undriven rows (3) and of the contact (2).
    k[:5, :5] = rows.T @ rows + 1e-6 * np.eye(5)
    k[5:7, 5:7] = force_cost(robot) * np.eye(2)
    constraints = np.zeros((5, 7))
    constraints[:3, :5], constraints[:3, 5:] = mass[:3], -J[:, :3].T
    constraints[3:, :5] = J
    k[7:, :7], k[:7, 7:] = constraints, constraints.T
    right = np.concatenate(
        [rows.T @ target, [0.0, force_cost(robot) * WEIGHT], -terms.bias[:3], -drift]
    )
    x = np.linalg.solve(k, right)
    torque = (mass @ x[:5] + terms.bias - J.T @ x[5:7])[3:] / gears.gear_ratio
    assert command.forces["foot"][2] > 0.0
    np.testing.assert_allclose(command.acceleration, x[:5], atol=1e-5)
    np.testing.assert_allclose(command.rotor_torque, torque, atol=1e-6)
