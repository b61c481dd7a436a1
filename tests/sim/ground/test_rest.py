"""Robots that are switched off fall, lie, and come to rest."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import load_robot
from wbc.sim import Plant

STEP = 2e-3  # [s]


@pytest.mark.parametrize(("name", "at_most"), [("solo12", 2.0), ("talos", 9.0), ("anymal", 18.0)])
def test_a_robot_that_is_switched_off_comes_to_rest(name: str, at_most: float) -> None:
    """TALOS jittered at 0.2 rad/s: most of its steps ended without friction that meets its law."""
    robot = load_robot(name)
    plant = Plant(robot)
    pose = robot.pose()
    pose[2] += 1.0 - plant.gaps(plant.state(pose)).min()
    pose[2] -= plant.gaps(plant.state(pose)).min()
    state, none, quiet = plant.state(pose), np.zeros(robot.transmission.size), 0
    deepest, made, start = 0.0, 0.0, plant.mechanical_energy(state)
    while state.time < at_most and quiet < 50:
        result = plant.step(state, none, STEP)
        state = result.state
        quiet = quiet + 1 if np.abs(state.velocity).max() < 1e-3 else 0
        deepest = min(deepest, float(plant.gaps(state).min()))
        made += sum(event.size for event in result.events if event.kind == "energy")
    assert quiet == 50
    assert deepest > -2e-6
    assert made < 1e-9 * (start - plant.mechanical_energy(state))
