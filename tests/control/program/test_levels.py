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
    Status,
    WarmStart,
)
from wbc.control.qp.level import Level, Refusal
from wbc.effects import load_robot

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


def test_a_lower_level_without_a_solution_leaves_the_upper_one_in_force(monkeypatch):
    robot = load_robot("solo12")
    upper = [CenterOfMassTask(), PostureTask.of(robot)]
    lower = FrameOrientationTask(name="trunk", frame=TRUNK["solo12"], level=1)
    alone = Controller(robot, upper, feet(robot))
    both = Controller(robot, [*upper, lower], feet(robot))
    gave_up = Refusal((Status.FAILED, "the solver gave up."), None, None)
    solve = Level.step
    second = both._levels.of(None, 1e-3)[0][1]
    monkeypatch.setattr(Level, "step", lambda s, *a: gave_up if s is second else solve(s, *a))
    state = next(moving_fast(robot, 1))
    one, two = alone.step(state), both.step(state)
    assert two.status is Status.INACCURATE
    assert two.message == "the tasks of a lower level are left out: the solver gave up."
    np.testing.assert_array_equal(two.rotor_torque, one.rotor_torque)
    assert two.solution.primal_residual(both.problem) < 1e-5
