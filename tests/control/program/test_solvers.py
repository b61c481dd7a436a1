"""What is infeasible, residuals of a wrong solution, and ticks that need no solver."""

from __future__ import annotations

import numpy as np

from tests.control.scenes import CERTAIN, arm, random_state
from wbc.control import (
    Controller,
    ControllerSettings,
    PostureTask,
    RotorTorqueLimit,
)
from wbc.control.qp.problem import QPStatus
from wbc.control.qp.solvers import solve
from wbc.robot import Motion


def test_residuals_see_a_wrong_solution():
    generator = np.random.default_rng(2)
    robot = arm(3, generator)
    q, v = random_state(robot, generator)
    settings = ControllerSettings(speed_blend=CERTAIN)
    controller = Controller(robot, [PostureTask.of(robot)], [], [RotorTorqueLimit()], settings)
    command = controller.step(Motion(q, v))
    solution, problem = command.solution, controller.problem
    assert command.rounds > 1
    assert solution.dual_residual(problem) < 1e-5
    off = type(solution)(solution.x + 1.0, solution.y, solution.z, QPStatus.SOLVED, 0)
    assert off.dual_residual(problem) > 0.1
    fresh = solve("proxqp", problem, tolerance=1e-9, most=100)
    np.testing.assert_allclose(fresh.x, solution.x, atol=1e-4)
