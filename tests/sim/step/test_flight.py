"""Free flight against its conservation laws, whatever the base frame and the step."""

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.bodies import free_body
from tests.sim.random_robots import random_robot
from wbc import Robot
from wbc.sim import Plane, Plant, SimState

FAR = Plane(height=-100.0)


def _motion(robot: Robot, state: SimState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centre of mass, its velocity, and the angular momentum about it, world axes."""
    model, data = robot.model, robot.model.createData()
    hg = pin.computeCentroidalMomentum(model, data, state.position, state.velocity)
    mass = sum(inertia.mass for inertia in model.inertias)
    return np.array(data.com[0]), np.array(hg.linear) / mass, np.array(hg.angular)


@pytest.mark.parametrize("lever", [(0.0, 0.0, 0.0), (0.1, -0.2, 0.3)])
def test_a_spinning_body_keeps_its_speed(lever) -> None:
    """20 rad/s and 5 m/s, 1000 steps of 1 ms: momenta exact, energy of second order.

    With a lever its base frame stands off its centre of mass.
    """
    body = pin.Inertia(2.0, np.array(lever), np.diag([0.02, 0.05, 0.07]))
    robot = free_body(body).with_gravity(np.zeros(3))
    plant, drift = Plant(robot, FAR), []
    for steps in (1000, 2000):
        spin = 20.0 * np.array([0.6, 0.64, 0.48])
        linear = np.array([3.0, 0.0, 4.0]) + np.cross(np.array(lever), spin)
        state = plant.state(robot.neutral(), np.concatenate((linear, spin)))
        center, speed, turn = _motion(robot, state)
        energy = plant.mechanical_energy(state)
        state = plant.run(state, [], 1.0, steps)[-1].state
        after = _motion(robot, state)
        assert np.linalg.norm(after[1]) == pytest.approx(5.0, rel=1e-6)
        assert after[0] == pytest.approx(center + speed, abs=1e-9)
        assert after[2] == pytest.approx(turn, rel=1e-9, abs=1e-9)
        drift.append(abs(plant.mechanical_energy(state) / energy - 1.0))
    assert drift[0] < 1e-4
    assert drift[1] < 0.3 * drift[0]


@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("seed", [0, 2])
def test_steps_that_are_too_long_for_a_fast_tree_make_no_energy(base, seed) -> None:
    """Links that turn by up to a radian in a step: its velocity terms alone made them fly off."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, base, 1.0, 1.0, 0.0, coupled=False).lossless()
    plant, told = Plant(robot, Plane(height=-1e4)), set()
    state = plant.state(robot.neutral(), 30.0 * rng.normal(size=robot.model.nv))
    start, turn = plant.mechanical_energy(state), _motion(robot, state)[2]
    for _ in range(100):
        result = plant.step(state, np.zeros(robot.transmission.size), 0.02)
        state = result.state
        told |= {event.kind for event in result.events}
    assert plant.mechanical_energy(state) < 1.03 * start
    assert told == {"coarse"}
    if base == "free":
        assert _motion(robot, state)[2] == pytest.approx(turn, rel=1e-6, abs=1e-6)
