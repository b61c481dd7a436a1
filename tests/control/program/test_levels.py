"""Tasks of level 1 under tasks that ask for more than the robot has freedoms."""

from __future__ import annotations

import numpy as np
import pytest

from sims.legged import feet
from tests.control.scenes import moving
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    PostureTask,
    RotorTorqueEffort,
    SpeedBlend,
    Status,
    WarmStart,
)
from wbc.control.qp.directions import DirectionSearch
from wbc.control.qp.level import Level, Refusal
from wbc.control.qp.linalg import extend_basis
from wbc.control.qp.problem import QPStatus
from wbc.control.qp.solvers import make_solver
from wbc.effects import load_robot
from wbc.robot import Motion

TRUNK = {"solo12": "base_link", "talos": "torso_2_link"}
TICKS = 200


def moving_fast(robot, seed):
    """Yield states around the stance, fast enough that friction cones bind in many of them."""
    return moving(robot, seed, TICKS, 0.02, 0.3)


@pytest.mark.parametrize("start", WarmStart, ids=lambda start: start.value)
@pytest.mark.parametrize("solver", ["proxqp", "daqp"])
@pytest.mark.parametrize("few", [False, True], ids=["all_feet", "half_the_feet"])
@pytest.mark.parametrize("name", TRUNK)
def test_every_tick_under_an_overdetermined_level_is_solved(name, few, solver, start):
    """Centre of mass and every joint are decided: level 1 is solved and changes neither."""
    robot = load_robot(name)
    upper = [CenterOfMassTask(), PostureTask.of(robot)]
    lower = FrameOrientationTask(name="trunk", frame=TRUNK[name], level=1)
    # motions are compared here, not what a tick may cost: 6 of 200 on Talos need 148 to 221 units
    settings = ControllerSettings(solver=solver, warm_start=start, max_iterations=1000)
    alone = Controller(robot, upper, feet(robot), settings=settings)
    both = Controller(robot, [*upper, lower], feet(robot), settings=settings)
    on = [foot.name for foot in feet(robot)]
    contacts = dict.fromkeys(on[: len(on) // 2] if few else on, np.inf)
    bound = 0
    for state in moving_fast(robot, 0):
        one, two = (c.step(state, contacts=contacts) for c in (alone, both))
        assert one.status is Status.SOLVED
        assert two.status is Status.SOLVED, two.message
        bound += bool((np.abs(one.solution.z) > 1e-5).any())
        scale = 1.0 + np.abs(one.acceleration).max()
        np.testing.assert_allclose(two.acceleration, one.acceleration, atol=1e-6 * scale)
    assert bound > TICKS // 10


def test_bounds_that_are_locked_cost_nothing():
    """Another solver finds nothing better where they stay bounds.

    But for wedges that are narrow and open: one of these six, by 3e-4 of the cost.
    """
    robot = load_robot("talos")
    trunk = FrameOrientationTask(name="trunk", frame=TRUNK["talos"])
    tasks = [CenterOfMassTask(), trunk, PostureTask.of(robot, level=1)]
    certain = SpeedBlend(full_speed=1e-9, correction=0.0, trusted_error=0.0)
    settings = ControllerSettings(speed_blend=certain, tolerance=1e-9, max_iterations=1000)
    controller = Controller(robot, tasks, feet(robot), settings=settings)
    more = []
    for seed in range(3, 9):
        for state in moving(robot, seed, 4, 0.005, 0.1):
            command = controller.step(state)
            assert command.status is Status.SOLVED
            lower = controller._level.program
            closed, rows = controller.problem, slice(0, lower.plain)
            low, high = lower.memory.stated_lower[rows], lower.memory.stated_upper[rows]
            tasked = lower.unlocked + 6  # centre of mass and trunk
            if len(closed.b) == tasked:
                continue
            x0 = controller._level._passing
            opened = closed._replace(
                A=closed.A[:tasked],
                b=closed.b[:tasked],
                lower=np.minimum(low, closed.C @ x0),
                upper=np.maximum(high, closed.C @ x0),
            )
            size = len(opened.g), len(opened.b), len(opened.lower)
            solver = make_solver("daqp", *size, tolerance=1e-9, max_iterations=1000)
            third = solver.solve(opened)
            if third.status is not QPStatus.SOLVED:
                continue  # a wedge too narrow for it
            cost = [0.5 * x @ closed.H @ x + closed.g @ x for x in (third.x, command.solution.x)]
            more.append((cost[1] - cost[0]) / abs(cost[0]))
    assert len(more) >= 5
    assert np.median(np.abs(more)) < 1e-7
    assert max(more) < 1e-3


def test_basis_says_the_same_as_rows_that_depend_on_one_another():
    generator = np.random.default_rng(0)
    fixed = generator.normal(size=(3, 9))
    fixed = np.vstack([fixed, fixed[0] + fixed[1]])
    rows = np.diag([1e3, 1.0, 1e-3]) @ generator.normal(size=(3, 9))
    rows = np.vstack([rows, rows[0] - 1e3 * rows[1] + fixed[2], np.zeros(9), fixed[3]])
    kept, left = np.zeros((10, 9)), np.zeros((10, 9))
    first = extend_basis(fixed, left, kept, 0)
    last = extend_basis(rows, left, kept, first)
    assert (first, last) == (3, 6)
    np.testing.assert_allclose(kept[:6] @ kept[:6].T, np.eye(6), atol=1e-14)
    span = np.linalg.svd(np.vstack([fixed, rows]))[2][:6]
    np.testing.assert_allclose(kept[:6].T @ kept[:6], span.T @ span, atol=1e-9)


def test_a_lower_level_without_a_solution_leaves_the_upper_one_in_force(monkeypatch):
    robot = load_robot("solo12")
    upper = [CenterOfMassTask(), PostureTask.of(robot)]
    lower = FrameOrientationTask(name="trunk", frame=TRUNK["solo12"], level=1)
    alone = Controller(robot, upper, feet(robot))
    both = Controller(robot, [*upper, lower], feet(robot))
    gave_up = Refusal((Status.FAILED, "the solver gave up."), None, None)
    solve = Level.step
    second = both._levels.of(None)[1]
    monkeypatch.setattr(Level, "step", lambda s, *a: gave_up if s is second else solve(s, *a))
    state = next(moving_fast(robot, 1))
    one, two = alone.step(state), both.step(state)
    assert two.status is Status.INACCURATE
    assert two.message == "the tasks of a lower level are left out: the solver gave up."
    np.testing.assert_array_equal(two.rotor_torque, one.rotor_torque)
    assert two.solution.primal_residual(both.problem) < 1e-5


@pytest.mark.parametrize("name", TRUNK)
def test_efforts_and_a_lower_level_need_no_solver_where_little_changes(name, monkeypatch):
    """Every tick is solved by the guess alone, and a solver finds the same."""
    robot = load_robot(name)
    trunk = FrameOrientationTask(name="trunk", frame=TRUNK[name])
    lower = PostureTask.of(robot, weight=0.1, level=1)
    tasks = [CenterOfMassTask(weight=10.0), trunk, lower, RotorTorqueEffort(weight=1e-2)]
    guessing = Controller(robot, tasks, feet(robot))
    settings = ControllerSettings(solver="daqp", warm_start=WarmStart.SOLVER, tolerance=1e-10)
    asking = Controller(robot, tasks, feet(robot), settings=settings)
    solve, asked = DirectionSearch.solve, []

    def counted(search, *given, **more):
        asked.append(search)
        return solve(search, *given, **more)

    monkeypatch.setattr(DirectionSearch, "solve", counted)
    generator = np.random.default_rng(2)
    q = next(iter(robot.poses.values()))
    for _ in range(20):
        state = Motion(q, 0.01 * generator.normal(size=robot.model.nv))
        one = guessing.step(state)
        assert not asked
        assert one.status is Status.SOLVED
        two = asking.step(state)
        assert len(asked) == 2
        asked.clear()
        np.testing.assert_allclose(one.acceleration, two.acceleration, atol=1e-6)
        np.testing.assert_allclose(one.rotor_torque, two.rotor_torque, atol=1e-6)
        problem = guessing.problem
        assert one.solution.primal_residual(problem) < 1e-6
        assert one.solution.dual_residual(problem) < 1e-6
