"""Impacts of random robots that are thrown at the ground, against pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.random_robots import BASES, random_robot
from tests.sim.step.test_compiled_part import contact_jacobian
from wbc.sim import Plane, Plant, SimState


def _hits(plant: Plant, state: SimState) -> int:
    """Hold the impacts of a step against the momentum balance; return how many there were."""
    robot = plant.robot
    gears = np.zeros((robot.transmission.size, robot.model.nv))
    gears[:, robot.actuated] = robot.transmission.motor_from_joint
    result = plant.step(state, np.zeros(len(gears)), 1e-7)
    inertia, jacobian = contact_jacobian(robot, state.position)
    for hit in result.impacts:
        scale = 1.0 + np.abs(hit.before).max()
        pushes = np.einsum("kxv,kx->v", jacobian, hit.contact_impulse)
        pushes += gears.T @ hit.solution.element_impulse
        size = 1.0 + np.abs(pushes).max()
        assert inertia @ (hit.after - hit.before) == pytest.approx(pushes, abs=1e-5 * size)
        turned = robot.transmission.reflected_inertia
        had, has = (
            0.5 * v @ inertia @ v + 0.5 * turned @ (gears @ v) ** 2 for v in (hit.before, hit.after)
        )
        assert hit.mesh_loss + hit.contact_loss == pytest.approx(had - has, abs=1e-5 * scale**2)
        assert min(hit.mesh_loss, hit.contact_loss) > -1e-9 * scale**2
        assert hit.solution.residuals.worst_speed < 1e-8 * scale
        assert hit.solution.residuals.dynamics < 1e-8 * scale
    return len(result.impacts)


def test_random_robots_hit_the_ground() -> None:
    hits = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        eta = rng.uniform(0.5, 1.0, 2)
        robot = random_robot(rng, BASES[seed % 3], eta[0], eta[1], rng.uniform(0.0, 1.2), False)
        q = robot.neutral()
        q[robot.actuated_position] = rng.uniform(-1.0, 1.0, robot.transmission.size)
        lowest = Plant(robot, Plane(height=-20.0))
        plant = Plant(robot, Plane(height=-20.0 + float(lowest.gaps(lowest.state(q)).min())))
        hits += _hits(plant, plant.state(q, 3.0 * rng.normal(size=robot.model.nv)))
    assert hits > 40
