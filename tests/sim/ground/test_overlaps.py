"""Points a little inside the ground: drift, the ends of landings, and how they come out again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sims.leg import balanced_pose
from tests.sim.bodies import block
from tests.sim.random_robots import random_robot
from wbc import load_robot
from wbc.sim import Plane, Plant
from wbc.sim.barriers import TOUCH


# Found by searching, with the steps it takes until the jam has lasted a few.
@pytest.mark.parametrize(("seed", "steps"), [(165, 9), (246, 40), (345, 14), (1245, 27)])
def test_a_point_that_friction_jams_rests_where_it_drifted(seed: int, steps: int) -> None:
    """One step inside the ground, on so few joints that steep friction holds every opening."""
    rng = np.random.default_rng(seed)
    gears = rng.uniform(0.5, 1.0), rng.uniform(0.02, 1.0)
    robot = random_robot(rng, "fixed", *gears, rng.uniform(0.0, 1.5), coupled=False)
    free = Plant(robot)
    q = pin.integrate(robot.model, robot.neutral(), rng.uniform(-1.0, 1.0, robot.model.nv))
    lowest = free.gaps(free.state(q)).min()
    plant = Plant(robot, Plane(height=lowest - rng.uniform(0.0, 0.05)))
    state = plant.state(q, rng.normal(size=robot.model.nv))
    torque = 5.0 * rng.normal(size=robot.transmission.size)
    for _ in range(steps):
        state = plant.step(state, torque / np.abs(robot.transmission.gear_ratio), 1e-3).state
    assert plant.gaps(state).min() > -2e-4


@pytest.mark.parametrize("dt", [1e-9, 1e-6, 1e-4, 1e-3])
def test_an_overlap_throws_nothing_up_however_short_the_step(dt: float) -> None:
    """A landing leaves up to half TOUCH; taken back within what is left of a step, it is a blow."""
    leg = load_robot("planar_leg_strong")
    plant = Plant(leg)
    state = plant.state(balanced_pose(leg, lift=-0.5 * TOUCH))
    state = replace(state, closed=plant.step(state, [0.0, 0.0], 1e-3).state.closed)
    assert plant.gaps(state).min() == pytest.approx(-0.5 * TOUCH, rel=1e-6)
    after = plant.step(state, [0.0, 0.0], dt).state
    assert plant.mechanical_energy(after) < plant.mechanical_energy(state) + 1e-4
    # Half a TOUCH in a millisecond turns the knee at 9 mrad/s; without motors it then sinks.
    assert np.abs(after.velocity).max() < 0.01 + 60.0 * dt


def test_an_overlap_is_gone_within_milliseconds() -> None:
    leg = load_robot("planar_leg_strong")
    plant = Plant(leg)
    state = plant.state(balanced_pose(leg, lift=-0.5 * TOUCH))
    for _ in range(50):
        state = plant.step(state, [0.0, 0.0], 1e-4).state
    assert plant.gaps(state).min() > -0.01 * TOUCH


def test_a_point_on_its_way_out_of_the_ground_lands_nowhere() -> None:
    """A fast impact can leave a point inside that moves out; looking for its landing crashed."""
    robot = block((0.2, 0.2, 0.1), friction=0.5)
    plant, q = Plant(robot), robot.neutral()
    q[2] = 0.04
    state = plant.state(q, [0, 0, 1.0, 0, 0, 0]).replace(closed=np.zeros(8, dtype=bool))
    result = plant.step(state, [], 1e-3)
    assert len(result.parts) == 1
    assert result.state.velocity[2] == pytest.approx(1.0 - 9.81e-3)
    falling = state.replace(velocity=-state.velocity)
    result = plant.step(falling, [], 1e-3)
    assert len(result.impacts) == 1
    assert abs(result.state.velocity[2]) < 1e-9
