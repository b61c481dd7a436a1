"""The compiled impact against the plain one, on random robots that are thrown at the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.random_robots import BASES, random_robot
from wbc import load_robot
from wbc.sim import Plane, Plant, SimState
from wbc.sim.ground.contact_rows import world_impulse
from wbc.sim.step.collision import settle


def _both(plant: Plant, state: SimState):
    """Return the impact by loops and the plain one."""
    setup = plant._setup
    assert setup.inner is not None
    return settle(setup, state, 1e-3), settle(replace(setup, inner=None), state, 1e-3)


def _rows(plant: Plant, state: SimState, fresh: np.ndarray):
    """Return the contacts that are hit."""
    setup = plant._setup
    pin.crba(setup.space.model, setup.space.data, state.position, pin.Convention.WORLD)
    clearance = setup.barriers.clearance(state.position, state.time)
    still = np.zeros(setup.barriers.size)
    return setup.barriers.rows(state.closed | fresh, clearance, still, 0.0, 0.0).contacts


def _compare(plant: Plant, state: SimState) -> bool:
    """Hold both against each other; return whether there was an impact."""
    (fast, hit, fresh), (slow, truth, reached) = _both(plant, state)
    np.testing.assert_array_equal(fresh, reached)
    np.testing.assert_array_equal(fast.closed, slow.closed)
    assert (hit is None) == (truth is None)
    if hit is None or truth is None:
        return False
    scale = 1.0 + np.abs(state.velocity).max()
    assert fast.velocity == pytest.approx(slow.velocity, abs=1e-7 * scale)
    # Which share each point of a foot carries is open: what they do to the robot is `dynamics`.
    pushes = world_impulse(_rows(plant, state, fresh), len(hit.contact_impulse), hit.solution)
    assert hit.contact_impulse == pytest.approx(pushes, abs=1e-12)
    assert hit.mesh_loss == pytest.approx(truth.mesh_loss, abs=1e-7 * scale**2)
    assert hit.contact_loss == pytest.approx(truth.contact_loss, abs=1e-7 * scale**2)
    assert hit.solution.residuals.worst_speed < 1e-8 * scale
    assert hit.solution.residuals.dynamics < 1e-8 * scale
    return True


def test_random_robots_hit_the_ground_alike() -> None:
    hits = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        eta = rng.uniform(0.5, 1.0, 2)
        robot = random_robot(rng, BASES[seed % 3], eta[0], eta[1], rng.uniform(0.0, 1.2), False)
        q = robot.neutral()
        q[robot.actuated_position] = rng.uniform(-1.0, 1.0, robot.transmission.size)
        lowest = Plant(robot, Plane(height=-20.0))
        plant = Plant(robot, Plane(height=-20.0 + float(lowest.gaps(lowest.state(q)).min())))
        closed = np.zeros(plant._setup.barriers.size, dtype=bool)
        state = plant.state(q, 3.0 * rng.normal(size=robot.model.nv)).replace(closed=closed)
        hits += _compare(plant, state)
    assert hits > 40


def test_four_feet_are_hit_alike() -> None:
    robot = load_robot("solo12")
    plant, rng = Plant(robot), np.random.default_rng(3)
    state = plant.state(robot.pose(), lifted=True)
    lift = float(plant.gaps(state).min())
    q = np.array(state.position)
    q[2] -= lift
    closed = np.zeros(plant._setup.barriers.size, dtype=bool)
    hits = 0
    for _ in range(20):
        v = 2.0 * rng.normal(size=robot.model.nv)
        hits += _compare(plant, plant.state(q, v).replace(closed=closed))
    assert hits > 10
