"""Compliant contacts: Hunt and Crossley's law against its closed relations, energy and rest."""

import coal
import numpy as np
import pytest

from tests.sim.bodies import free
from wbc import load_robot
from wbc.robot import FreeBody
from wbc.sim import HuntCrossley, Plane, Plant, Stairs

_K = 1e6  # [N/m^(3/2)]
_MASS, _RADIUS = 1.0, 0.1


def bounce(dissipation: float, speed: float, step: float) -> tuple[float, float]:
    """Return speed after over before, and the peak force [N], of a ball without gravity."""
    robot = free(FreeBody("ball", coal.Sphere(_RADIUS), _MASS)).with_gravity(np.zeros(3))
    plant = Plant(robot, compliance=HuntCrossley(_K, dissipation))
    state, peak = plant.state([0, 0, _RADIUS, 0, 0, 0, 1], [0, 0, -speed, 0, 0, 0]), 0.0
    energy = plant.mechanical_energy(state)
    for _ in range(round(0.2 / step)):
        result = plant.step(state, [], step)
        state, peak = result.state, max(peak, result.contact_force[0, 2])
        assert result.impacts == ()
        assert result.events == ()
        assert abs(result.balance.residual) < 1e-9 * energy
        if state.velocity[2] > 0.0 and state.position[2] > _RADIUS:
            return state.velocity[2] / speed, peak
    raise AssertionError("the ball does not leave")


def test_a_peak_force_converges_to_the_one_of_a_spring() -> None:
    """m v^2 / 2 = 2/5 K d^(5/2) at the deepest place, where F = K d^(3/2)."""
    depth = (1.25 * _MASS / _K) ** 0.4
    errors = []
    for step in (2e-3, 5e-4, 1.25e-4):
        share, peak = bounce(0.0, 1.0, step)
        assert share == pytest.approx(1.0, abs=1e-9)
        errors.append(abs(peak / (_K * depth**1.5) - 1.0))
    assert errors[2] < 2e-3
    assert errors[2] < errors[1] < errors[0] < 0.2


def test_the_loss_is_that_of_the_law_in_fine_steps() -> None:
    """Large losses, against the law integrated with steps of 1e-6 s."""
    a, v, d, h = 0.5, 1.0, 0.0, 1e-6
    while d > 0.0 or v > 0.0:
        v -= h / _MASS * max(_K * max(d, 0.0) ** 1.5 * (1.0 + 1.5 * a * v), 0.0)
        d += h * v
    share, _ = bounce(a, 1.0, 1e-4)
    assert share == pytest.approx(-v, abs=1e-3)


def test_a_quadruped_and_a_plank_stand_on_compliant_ground() -> None:
    soft = HuntCrossley(1e6, 1.0)
    plank = free(FreeBody("plank", coal.Box(0.6, 0.4, 0.1), 2.0))
    stair = Stairs(edges=np.array([0.0]), heights=np.array([0.0, 0.1]))
    plant = Plant(plank, stair, compliance=soft)
    state = plant.run(plant.state([-0.05, 0.0, 0.35, 0, 0, 0, 1]), [], 2.0, 2000)[-1].state
    assert plant.pair_gaps(state).min() > -1e-3
    assert state.position[2] > 0.08
    plant = Plant(load_robot("solo12"), Plane(), compliance=soft)
    results = plant.run(plant.state(plant.robot.pose(), lifted=True), np.zeros(12), 0.5, 500)
    for result in results:
        assert all(not impact.contact_impulse.any() for impact in result.impacts)
    assert plant.gaps(results[-1].state).min() > -2e-3
