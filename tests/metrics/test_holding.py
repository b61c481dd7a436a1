"""Holding and backdriving against the simulator at rest."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import DynamicsError
from wbc.metrics import backdriving_force, backdriving_torque, holding
from wbc.robot import Robot

UP = [0.0, 1.0]


def rubbing(name: str = "planar_leg_strong") -> Robot:
    robot = load_robot(name)
    gears = robot.transmission.replace(rotor_coulomb_friction=np.array([0.01, 0.02]))
    return robot.with_transmission(gears)


def test_the_knee_holds_its_share_of_the_load_with_eta_b_of_the_torque() -> None:
    robot = load_robot("planar_leg_strong")
    found = holding(robot, robot.pose("paper"), "foot", UP, 200.0, "xz")
    # The foot is straight under the hip: the knee's lever is 0.2 m, the reduction 20.
    np.testing.assert_allclose(found.lossless, [0.0, 2.0], atol=1e-12)
    eta_b = robot.transmission.backward_efficiency[1]
    np.testing.assert_allclose(found.least, [0.0, 2.0 * eta_b], atol=1e-12)
    np.testing.assert_allclose(found.most, [0.0, 2.0 / 0.7], atol=1e-12)
    assert found.heat_lossless == pytest.approx(0.1 * (2.0 / 0.1) ** 2)
    assert found.heat_saved == pytest.approx(1.0 - eta_b**2)
    assert found.heat_least == pytest.approx(found.heat_lossless * eta_b**2)


def test_rotor_friction_eases_holding_and_costs_lifting() -> None:
    found = holding(rubbing(), rubbing().pose("paper"), "foot", UP, 200.0, "xz")
    eta_b = 2.0 - 1.0 / 0.7
    np.testing.assert_allclose(found.least, [0.0, 2.0 * eta_b - 0.02], atol=1e-12)
    np.testing.assert_allclose(found.most, [0.01, 2.0 / 0.7 + 0.02], atol=1e-12)


def test_self_locking_gears_hold_for_nothing_and_never_give() -> None:
    robot = load_robot("planar_leg_strong")
    gears = robot.transmission.replace(backward_efficiency=np.array([0.5, -0.1]))
    locked = robot.with_transmission(gears)
    found = holding(locked, locked.pose("paper"), "foot", UP, 200.0, "xz")
    assert found.least[1] == 0.0
    assert found.heat_saved == 1.0
    assert backdriving_force(locked, locked.pose("paper"), "foot", UP, "xz") == np.inf
    np.testing.assert_array_equal(backdriving_torque(locked), [0.0, np.inf])


def test_the_force_that_moves_the_unpowered_leg() -> None:
    robot = rubbing()
    threshold = 20 * 0.02 / (2.0 - 1.0 / 0.7)
    assert backdriving_torque(robot)[1] == pytest.approx(threshold)
    force = backdriving_force(robot, robot.pose("paper"), "foot", UP, "xz")
    assert force == pytest.approx(threshold / 0.2)


def test_unknown_motors_count_as_equal() -> None:
    robot = load_robot("planar_leg")
    found = holding(robot, robot.pose("paper"), "foot", UP, 50.0, "xz")
    assert np.isnan(found.heat_lossless)
    assert found.heat_saved == pytest.approx(1.0 - (2.0 - 1.0 / 0.7) ** 2)
    assert holding(robot, robot.pose("paper"), "foot", UP, 0.0, "xz").heat_saved == 0.0
    with pytest.raises(DynamicsError, match="load"):
        holding(robot, robot.pose("paper"), "foot", UP, -1.0, "xz")
