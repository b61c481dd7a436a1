"""How likely orders of ripple are before logs speak: what gears can make weighs more."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import Robot, load_robot
from wbc.effects import TorqueRipple
from wbc.identification import diagnose
from wbc.robot import Motion
from wbc.sim.excitation import record_with

RATIO = 20.0


@pytest.fixture(scope="module")
def leg() -> Robot:
    robot = load_robot("planar_leg_fixed").lossless()
    assert robot.transmission.gear_ratio[1] == RATIO
    return robot


def passing(span: float) -> list[Motion]:
    """Return a motion over a range of angles [rad] of both joints."""
    q = np.linspace(0.0, span, 50)[:, None] * np.ones(2)
    return [Motion(q, np.ones_like(q))]


def cost(robot: Robot, order: float, span: float) -> float:
    return TorqueRipple.search.implausibility(
        TorqueRipple("knee", 0.1, order, 0.0), robot, passing(span)
    )


@pytest.mark.parametrize("times", [1, 2, 3])
def test_orders_that_the_rotor_makes_cost_less_than_those_between(leg: Robot, times: int) -> None:
    span = 2.0  # [rad]: waves that differ by 3.1 periods per turn are told apart
    odd = cost(leg, (times + 0.5) * RATIO, span)
    assert cost(leg, times * RATIO, span) < odd - 0.7
    assert cost(leg, (times - 0.5) * RATIO, span) == pytest.approx(
        np.log(1.5 * (times - 0.5) * RATIO * span / (2.0 * np.pi)), abs=0.05
    )
    # Within what these motions tell apart nothing jumps.
    orders = np.linspace(0.5, 3.5, 2000) * RATIO
    costs = [cost(leg, float(order), span) for order in orders]
    assert np.abs(np.diff(costs)).max() < 0.1


def test_where_turns_of_the_rotor_are_not_told_apart_all_orders_are_alike(leg: Robot) -> None:
    """The density is then 1 / order, and a wave of n periods one of n."""
    span = 0.15
    for order in (60.0, 70.0, 90.0, 200.0):
        periods = order * span / (2.0 * np.pi)
        assert cost(leg, order, span) == pytest.approx(np.log(periods), abs=0.1)


def test_a_wave_of_the_rotor_is_more_certain_than_one_beside_it(leg: Robot) -> None:
    certain, remarks = {}, {}
    for order in (2.0 * RATIO, 2.3 * RATIO):
        ripple = TorqueRipple("knee", 0.1, order, 0.5)
        logs = record_with(leg, [ripple], duration=3.0)
        diagnosis = diagnose(leg, logs, [TorqueRipple])
        (finding,) = diagnosis.findings
        assert finding.effect.values["order"] == pytest.approx(order, rel=0.01)
        certain[order], remarks[order] = (
            finding.probability,
            finding.effect.search.remarks(finding.effect, leg),
        )
    # With orders alike on any scale it was 0.80 and 0.77.
    assert certain[2.0 * RATIO] > certain[2.3 * RATIO] + 0.1
    assert remarks[2.0 * RATIO] == ("This is 2 per turn of the rotor.",)
    assert remarks[2.3 * RATIO] == ()
