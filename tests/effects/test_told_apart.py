"""Effects that are much alike: what tells them apart, and what no log can show of them."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import Robot
from wbc.effects import (
    DirectionalViscousFriction,
    JointSpring,
    ThermalViscousFriction,
    TorqueRipple,
    ViscousFriction,
)
from wbc.identification import diagnose
from wbc.measurement import Log
from wbc.robot import Effect, Motion
from wbc.sim.excitation import ENCODER, record_run, record_with

COLD, WARM, RATIO = 20.0, 60.0, 20.0


def logs_of(leg: Robot, effect: Effect, temperatures: list[float | None]) -> list[Log]:
    real = leg.with_effect(effect)
    logs = []
    for k, degrees in enumerate(temperatures):
        warm = None if degrees is None else np.full(2, degrees)
        logs.append(ENCODER.measure(real, record_run(real, leg, 7 + k // 2, 3.0, warm), k))
    return logs


@pytest.mark.parametrize(
    ("effect", "temperatures"),
    [
        (ThermalViscousFriction("knee", 0.6, 0.03), [COLD, WARM, COLD, 40.0]),
        (DirectionalViscousFriction("hip", 0.6, 0.2), [None, None, None]),
    ],
    ids=["by temperature", "by direction"],
)
def test_friction_that_differs_is_named_with_its_numbers(
    leg: Robot, effect: Effect, temperatures: list[float | None]
) -> None:
    diagnosis = diagnose(leg, logs_of(leg, effect, temperatures))
    assert diagnosis.verdict == "named"
    (found,) = diagnosis.effects
    assert found.key == effect.key
    assert found.values == pytest.approx(effect.values, rel=0.02)


def test_friction_alike_in_both_directions_is_plain_viscous_friction(leg: Robot) -> None:
    """With one number more it does as well; until it cost a name, every answer was tied."""
    logs = record_with(leg, [ViscousFriction("knee", 0.3)], duration=6.0)
    found = diagnose(leg, logs)
    assert found.verdict == "named"
    assert [(one.effect.key, one.rivals) for one in found.findings] == [
        (("viscous_friction", "knee"), ())
    ]


def test_one_temperature_or_one_direction_shows_no_such_friction(leg: Robot) -> None:
    v = np.stack([np.linspace(-1.0, 1.0, 50), np.linspace(0.1, 1.0, 50)], axis=1)
    same = Motion(np.zeros((50, 2)), v, temperature=np.full((50, 2), 40.0))
    warmer = same.replace(temperature=np.full((50, 2), 50.0))
    thermal = ThermalViscousFriction("knee", 0.4, 0.03)
    hip, knee = (DirectionalViscousFriction(joint, 0.4, 0.1) for joint in ("hip", "knee"))
    for effect, motions, shown in (
        (thermal, [same], False),
        (thermal, [same.replace(temperature=None)], False),
        (thermal, [same, warmer], True),
        (hip, [same], True),
        (knee, [same], False),
    ):
        assert effect.search.recognisable(effect, leg, motions) is shown


@pytest.mark.parametrize(
    ("effect", "travel", "known"),
    [
        (TorqueRipple("knee", 1.0, 5.0, 0.0), 1.0, False),
        (TorqueRipple("knee", 1.0, 7.0, 0.0), 1.0, True),
        (JointSpring("knee", 1000.0, 0.5), 1e-4, False),
        (JointSpring("knee", 1000.0, 0.5), 0.1, True),
    ],
)
def test_a_ripple_shows_from_one_period_on_and_a_spring_where_its_joint_moves(
    leg: Robot, effect: Effect, travel: float, known: bool
) -> None:
    position = np.zeros((50, 2))
    position[:, 1] = 0.4 + np.linspace(0.0, travel, 50)
    motion = Motion(position, np.zeros((50, 2)))
    assert effect.search.recognisable(effect, leg, [motion]) is known


def cost(robot: Robot, order: float, span: float) -> float:
    """Return what an order of ripple costs in nats where both joints pass over a range [rad]."""
    q = np.linspace(0.0, span, 50)[:, None] * np.ones(2)
    ripple = TorqueRipple("knee", 0.1, order, 0.0)
    return TorqueRipple.search.implausibility(ripple, robot, [Motion(q, np.ones_like(q))])


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
    for order in (60.0, 70.0, 90.0, 200.0):
        expected = np.log(order * 0.15 / (2.0 * np.pi))
        assert cost(leg, order, 0.15) == pytest.approx(expected, abs=0.1)


def test_a_wave_of_the_rotor_is_more_certain_than_one_beside_it(leg: Robot) -> None:
    certain, remarks = {}, {}
    for order in (2.0 * RATIO, 2.3 * RATIO):
        ripple = TorqueRipple("knee", 0.1, order, 0.5)
        diagnosis = diagnose(leg, record_with(leg, [ripple], duration=3.0), [TorqueRipple])
        (finding,) = diagnosis.findings
        assert finding.effect.values["order"] == pytest.approx(order, rel=0.01)
        certain[order] = finding.probability
        remarks[order] = finding.effect.search.remarks(finding.effect, leg)
    # With orders alike on any scale it was 0.80 and 0.77.
    assert certain[2.0 * RATIO] > certain[2.3 * RATIO] + 0.1
    assert remarks[2.0 * RATIO] == ("This is 2 per turn of the rotor.",)
    assert remarks[2.3 * RATIO] == ()
