"""Robots whose rotors turn with the links that carry them, with heavy rotors and lossy gears."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.random_robots import BASES, random_robot
from wbc import load_robot
from wbc.errors import SimulationError
from wbc.sim import Plant


@pytest.mark.parametrize("seed", [90, 137, 178, 207])
def test_impacts_of_heavy_rotors_behind_lossy_gears_have_a_solution(seed):
    """What a housing takes of its rotor's momentum leaves the law of an impact monotone."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, BASES[(2, 1, 0)[seed % 3]], 0.05, 0.1, 1.0, True)
    gears = robot.transmission
    heavy = gears.replace(
        gear_ratio=gears.gear_ratio / 10.0,
        rotor_inertia=30.0 * gears.rotor_inertia,
        forward_efficiency=np.full(gears.size, 0.05),
        backward_efficiency=np.full(gears.size, 0.3),
    )
    plant = Plant(robot.with_transmission(heavy))
    q = pin.integrate(robot.model, robot.neutral(), 0.4 * rng.normal(size=robot.model.nv))
    state = plant.state(q, 3.0 * rng.normal(size=robot.model.nv), lifted=True)
    for _ in range(60):
        result = plant.step(state, np.zeros(gears.size), 5e-3)
        assert not [event for event in result.events if event.kind == "energy"]
        state = result.state


def test_a_rotor_with_more_inertia_than_its_housing_is_refused_by_name():
    """Its kinetic energy could be negative: no solver helps."""
    solo = load_robot("solo12")
    gears, many = solo.transmission, np.where(np.arange(12) == 4, 1e5, 1.0)
    heavy = gears.replace(rotor_inertia=many * gears.rotor_inertia)
    with pytest.raises(SimulationError, match=rf"rotor of '{gears.joints[4]}'.*be negative"):
        Plant(replace(solo.with_transmission(heavy), rotors_turn_with_links=True))
    Plant(replace(solo, rotors_turn_with_links=True))
