"""Simulated metrics against what physics says of them."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.design.simulated import SIMULATIONS, simulate_design
from wbc.effects import load_robot
from wbc.errors import DesignError
from wbc.metrics import impact_mitigation
from wbc.robot import Robot


def leg(limit: float = 5.0, efficiency: float | None = None, ratio: float = 20.0) -> Robot:
    robot = load_robot("planar_leg_strong")
    gears = robot.transmission.replace(torque_limit=np.full(2, limit), gear_ratio=np.full(2, ratio))
    if efficiency is not None:
        gears = gears.replace(forward_efficiency=np.full(2, efficiency), backward_efficiency=None)
    return robot.with_transmission(gears)


def test_a_drop_on_ice_is_what_the_impact_mitigation_predicts() -> None:
    from dataclasses import replace

    robot = leg()
    smooth = replace(robot, contacts=tuple(replace(c, friction=0.0) for c in robot.contacts))
    locked = smooth.with_transmission(
        smooth.transmission.replace(backward_efficiency=np.full(2, -1.0))
    )
    q = robot.pose()
    give, rigid = (simulate_design("drop", r, q, "foot") for r in (smooth, locked))
    factor = impact_mitigation(smooth, q, "foot", "xz").along([0, 1])
    assert give["drop_impulse"] / rigid["drop_impulse"] == pytest.approx(1.0 - factor, rel=1e-3)
    assert give["drop_mesh_loss"] > 0.0
    assert rigid["drop_mesh_loss"] == pytest.approx(0.0, abs=1e-9)


def test_solo12_trots_and_worse_gears_cost_more() -> None:
    robot = load_robot("solo12")
    costs = []
    for eta in (0.9, 0.7):
        gears = robot.transmission.replace(
            forward_efficiency=np.full(12, eta), backward_efficiency=None, resistance=np.ones(12)
        )
        found = simulate_design("trot", robot.with_transmission(gears), robot.pose(), "FL_foot")
        assert set(found) == set(SIMULATIONS["trot"].columns)
        assert found["trot_speed"] == pytest.approx(0.5, abs=0.03)
        # No motor gives less than the work without its heat, and no design trots for nothing.
        assert 0.05 < found["trot_work_cost"] < found["trot_cost"]
        costs.append(found["trot_work_cost"])
    assert costs[1] > 1.1 * costs[0]
    tired = robot.transmission.replace(torque_limit=np.full(12, 0.02))
    weak = simulate_design("trot", robot.with_transmission(tired), robot.pose(), "FL_foot")
    assert np.isnan(weak["trot_work_cost"])
    with pytest.raises(DesignError, match="one in each corner"):
        simulate_design("trot", leg(), leg().pose(), "foot")


def test_a_larger_quadruped_trots_like_the_smaller_one() -> None:
    robot = load_robot("anymal")
    found = simulate_design("trot", robot, robot.pose(), "LF_foot")
    # Equal Froude numbers: the speed grows with the root of the height, 0.479 and 0.223 m.
    assert found["trot_speed"] == pytest.approx(0.5 * np.sqrt(0.479 / 0.223), rel=0.06)


def test_standing_costs_the_interval_s_lower_end() -> None:
    robot = leg(efficiency=0.7)
    found = simulate_design("standing", robot, robot.pose(), "foot")
    backward = 2.0 - 1.0 / 0.7
    assert found["standing_torque"] == pytest.approx(
        backward * found["standing_neutral_torque"], rel=1e-3
    )
    assert found["standing_heat"] == pytest.approx(0.1 / 0.1**2 * found["standing_torque"] ** 2)


def test_a_leg_too_weak_to_stand_or_hop_is_no_number() -> None:
    robot = leg(limit=0.5)
    assert np.isnan(simulate_design("standing", robot, robot.pose(), "foot")["standing_heat"])
    assert simulate_design("hop", robot, robot.pose(), "foot")["hop_height"] == 0.0


def test_a_hop_costs_more_than_the_height_it_gives_and_losses_cost() -> None:
    rows = [simulate_design("hop", leg(efficiency=eta), leg().pose(), "foot") for eta in (0.7, 1.0)]
    for row in rows:
        lifted = 19.0 * 9.81 * row["hop_height"]  # 15 kg and two links of 2 kg
        assert row["hop_energy"] > lifted
        assert row["hop_cost"] == pytest.approx(row["hop_energy"] / lifted, rel=1e-6)
    assert rows[0]["hop_cost"] > rows[1]["hop_cost"]


def test_wrong_efficiencies_cost_height_in_a_landing() -> None:
    robot = leg(efficiency=0.8)
    found = simulate_design("landing", robot, robot.pose(), "foot")
    assert found["landing_error"] < 2e-4
    assert found["landing_error_high"] > 10.0 * found["landing_error"]
    assert found["landing_error_low"] > 10.0 * found["landing_error"]
