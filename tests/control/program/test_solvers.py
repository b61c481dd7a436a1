"""What is infeasible, residuals of a wrong solution, and ticks that need no solver."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.controller_modes import modes
from tests.control.scenes import CERTAIN, arm, leg_controller, random_state
from wbc.control import (
    Controller,
    ControllerSettings,
    PostureTask,
    Status,
)
from wbc.control.qp.directions import DirectionSearch
from wbc.control.qp.problem import QPStatus
from wbc.control.qp.solvers import make_solver
from wbc.effects import load_robot
from wbc.robot import Motion


@pytest.mark.parametrize("solver", ["proxqp", "daqp"])
def test_solvers_agree_on_what_is_infeasible(solver):
    generator = np.random.default_rng(1)
    robot = load_robot("planar_leg_strong")
    robot = robot.with_transmission(robot.transmission.replace(torque_limit=[1.0, 1.0]))
    reference = leg_controller(robot)
    other = leg_controller(robot, solver=solver)
    seen = set()
    for _ in range(30):
        q, v = random_state(robot, generator)
        one, two = reference.step(Motion(q, v)), other.step(Motion(q, v))
        assert one.status.usable is two.status.usable
        seen.add(one.status.usable)
    assert seen == {True, False}


def test_residuals_see_a_wrong_solution():
    generator = np.random.default_rng(2)
    robot = arm(3, generator)
    q, v = random_state(robot, generator)
    controller = Controller(
        robot, [PostureTask.of(robot)], settings=ControllerSettings(speed_blend=CERTAIN)
    )
    command = controller.step(Motion(q, v))
    solution, problem = command.solution, controller.problem
    assert command.rounds > 1
    assert solution.dual_residual(problem) < 1e-5
    off = type(solution)(solution.x + 1.0, solution.y, solution.z, QPStatus.SOLVED, 0)
    assert off.dual_residual(problem) > 0.1
    fresh = make_solver("proxqp", 3, 0, 3, tolerance=1e-9, max_iterations=100).solve(problem)
    np.testing.assert_allclose(fresh.x, solution.x, atol=1e-4)


def test_a_swinging_foot_is_guessed_within_a_few_steps(monkeypatch):
    """Noise changes which feet slip from tick to tick; the whole program is not needed for it."""
    label, ours, states, more = modes("solo12")[2]
    assert "one foot swings" in label
    searched, whole = [], DirectionSearch.solve
    monkeypatch.setattr(
        DirectionSearch, "solve", lambda *a, **k: searched.append(1) or whole(*a, **k)
    )
    commands = [ours.step(state, **more) for state in states[:200]]
    assert all(command.status is Status.SOLVED for command in commands)
    assert not searched  # 80 of 200 ticks without the dual steps
