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


def test_a_robot_kneels_on_its_shanks() -> None:
    robot = load_robot("solo12")
    plant = Plant(robot)
    joints = robot.transmission.joints
    places = [robot.position_index(joint) for joint in joints]
    rows = [robot.velocity_index(joint) for joint in joints]
    pose = robot.pose()
    for leg in ("FL", "FR", "HL", "HR"):
        pose[robot.position_index(f"{leg}_HFE")] = 0.8
        pose[robot.position_index(f"{leg}_KFE")] = -0.8 - np.pi / 2
    state, made = plant.state(pose, lifted=True), 0.0
    for _ in range(1000):
        held = 8.0 * (pose - state.position)[places] - 0.3 * state.velocity[rows]
        result = plant.step(state, held / robot.transmission.gear_ratio, 1e-3)
        state = result.state
        made += sum(event.size for event in result.events if event.kind == "energy")
    pressed = {
        contact.frame
        for contact, force in zip(plant.contacts, result.contact_force, strict=True)
        if force[2] > 0.1
    }
    weight = 9.81 * sum(body.mass for body in robot.model.inertias)
    assert made == 0.0
    assert np.abs(state.velocity).max() < 1e-6
    assert {f"{leg}_UPPER_LEG" for leg in ("FL", "FR", "HL", "HR")} <= pressed
    np.testing.assert_allclose(result.contact_force[:, 2].sum(), weight, rtol=1e-6)
