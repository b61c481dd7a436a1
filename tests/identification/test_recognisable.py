"""A wave of which less than one period was passed is a bend, and must not be named a ripple."""

import numpy as np
import pytest

import wbc
from sims.excitation import record_with
from wbc.effects import CustomTorque, TorqueRipple
from wbc.identification import diagnose
from wbc.robot import Motion


@pytest.mark.parametrize(("order", "known"), [(5.0, False), (7.0, True)])
def test_a_ripple_is_recognised_from_one_period_on(order: float, known: bool) -> None:
    leg = wbc.load_robot("planar_leg_fixed")
    position = np.zeros((50, 2))
    position[:, 1] = np.linspace(0.3, 1.3, 50)
    motion = Motion(position, np.zeros((50, 2)))
    assert TorqueRipple("knee", 1.0, order, 0.0).recognisable(leg, [motion]) is known


def test_a_one_sided_cable_is_no_spring_with_a_slow_ripple() -> None:
    """A cable that pulls from the middle of the range on has a kink, which a slow wave imitates."""
    leg = wbc.load_robot("planar_leg_fixed").lossless()
    cable = CustomTorque.at("hip", {"q_hip": -1.5, "|q_hip|": -1.5})
    diagnosis = diagnose(leg, record_with(leg, [cable], duration=4.0))
    assert not any(
        effect.name == "torque_ripple" and effect.values["order"] < 2.0
        for effect in diagnosis.effects
    )
    assert diagnosis.verdict == "unknown"
