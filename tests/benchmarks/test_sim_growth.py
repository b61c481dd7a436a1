"""The robots on which the cost of a step is measured stand, and the exponent is one."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.sim_cases import DT
from benchmarks.sim_growth import exponent, legged
from benchmarks.sim_time import mujoco_run, plant_run
from wbc.sim import Plant


@pytest.mark.parametrize(("legs", "points"), [(4, 2), (0, 8)])
def test_the_robots_stand_on_all_their_points(legs, points):
    case = legged(legs, points, feet=0.02 if legs else 0.2)
    robot, command = case.robot, case.command()
    assert robot.transmission.size == 3 * legs
    assert len(robot.contacts) == max(legs, 1) * points
    plant, state = Plant(robot), case.start
    result = plant.step(state, command(state.position, state.velocity), DT)
    weight = 9.81 * pin.computeTotalMass(robot.model)
    assert result.contact_force[:, 2].sum() == pytest.approx(weight, rel=0.2)
    assert (np.abs(plant.gaps(result.state)) < 1e-4).all()


def test_robots_in_the_air_touch_nothing():
    case = legged(2, 0, high=50.0)
    assert case.robot.contacts == ()
    assert case.start.position[2] > 50.0


def test_the_exponent_is_the_slope_of_the_larger_half():
    sizes = [1, 2, 4, 8, 16, 32]
    assert exponent(sizes, [5.0, 5.0, 5.0, 64.0, 256.0, 1024.0]) == pytest.approx(2.0)


def test_both_engines_take_the_steps_that_they_are_timed_for():
    case = legged(2, 2)
    for timed in (plant_run, mujoco_run):
        run, count = timed(case)
        run()
        assert count >= case.steps


def test_feet_that_rock_split_no_step():
    """Feet that land or part slowly stay rows; as impacts of their own they made up to 7 parts."""
    case = legged(20, 2)
    plant, command, state, impacts = Plant(case.robot), case.command(), case.start, 0
    for _ in range(case.steps):
        result = plant.step(state, command(state.position, state.velocity), DT)
        state, impacts = result.state, impacts + len(result.impacts)
        assert len(result.parts) == 1
        assert {part.solution.method for part in result.parts} == {"newton"}
        assert not [event for event in result.events if event.kind == "energy"]
    assert impacts > 3
