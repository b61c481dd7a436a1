"""Every problem through several solvers: they agree, and each solution knows its own residuals."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.controller_modes import modes
from tests.control.scenes import CERTAIN, arm, leg_controller, random_state
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PostureTask,
    Reference,
    Status,
    WarmStart,
)
from wbc.control.qp.directions import DirectionSearch
from wbc.control.qp.problem import QPStatus
from wbc.control.qp.solvers import ForeignSolver, make_solver
from wbc.effects import load_robot
from wbc.robot import Motion

SOLVERS = ("proxqp", "daqp")


def controllers(name):
    robot = load_robot(name)
    tasks = [CenterOfMassTask(), PostureTask.of(robot, weight=0.1)]
    contacts = [PointContact(name=contact.name) for contact in robot.contacts]
    return robot, [
        Controller(
            robot,
            tasks,
            contacts,
            settings=ControllerSettings(solver=solver, warm_start=WarmStart.SOLVER),
        )
        for solver in SOLVERS
    ] + [Controller(robot, tasks, contacts)]


@pytest.mark.parametrize("name", ["solo12", "anymal"])
def test_two_solvers_and_the_guess_give_one_command(name):
    robot, all_three = controllers(name)
    q = next(iter(robot.poses.values()))
    generator = np.random.default_rng(0)
    for _ in range(20):
        motion = Motion(q, 0.1 * generator.normal(size=robot.model.nv))
        wish = {"posture": Reference(q[7:] + 0.1 * generator.normal(size=12))}
        commands = [controller.step(motion, wish) for controller in all_three]
        one = commands[0]
        scale = 1.0 + np.abs(one.acceleration).max()
        for other in commands:
            assert other.status is Status.SOLVED
            np.testing.assert_allclose(one.acceleration, other.acceleration, atol=1e-4 * scale)
            np.testing.assert_allclose(one.rotor_torque, other.rotor_torque, atol=1e-4)
        for controller, command in zip(all_three, commands, strict=True):
            problem, solution = controller.problem, command.solution
            assert solution.primal_residual(problem) < 1e-5
            assert solution.dual_residual(problem) < 1e-5 * scale
            assert solution.duality_gap(problem) < 1e-4 * scale**2


@pytest.mark.parametrize("solver", SOLVERS)
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


def test_reloaded_program_has_the_same_solution(tmp_path):
    """The program of a tick, written to a file, is solved again by another solver."""
    robot, (controller, *_) = controllers("solo12")
    q = next(iter(robot.poses.values()))
    command = controller.step(Motion(q, np.zeros(18)))
    path = controller.problem.save(tmp_path / "tick.npz")
    again = type(controller.problem).load(path)
    for name, array in zip(again._fields, again, strict=True):
        np.testing.assert_array_equal(array, getattr(controller.problem, name))
    found = ForeignSolver("daqp").solve(again)
    np.testing.assert_allclose(found.x, command.solution.x, atol=1e-4)


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
