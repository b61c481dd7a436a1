"""A robot without losses gets the classical controller, written down again and solved twice."""

from __future__ import annotations

import numpy as np
import pytest

from tests.control.program.independent import solve_in_directions
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
