"""A cause whose size may be nothing by its own interval is not certain."""

import pytest

from wbc.effects import (
    CoulombFriction,
    GravityDirection,
    JointSpring,
    LoadFriction,
    TransmissionEfficiency,
)
from wbc.effects.links import LinkInertia
from wbc.identification import Estimate
from wbc.identification.answer.findings import sized
from wbc.identification.choice.certainty import CERTAIN
from wbc.robot import Effect


def estimates(**numbers: tuple[float, float, float]) -> dict[str, Estimate]:
    return {name: Estimate(own[0], "1", *own[1:]) for name, own in numbers.items()}


@pytest.mark.parametrize(
    ("effect", "numbers"),
    [
        # A recorded arm: dry friction of 0.7 N m, anything from none to 2.7 N m, was certain.
        (CoulombFriction("hip", 0.7), estimates(level=(0.7, 0.0, 2.744))),
        # A recorded quadruped: intervals that are cut at nothing were 95.0015 % sure.
        (LoadFriction("hip", 0.95), estimates(coefficient=(0.95, 0.0, 0.95))),
        (LoadFriction("hip", 0.1761), estimates(coefficient=(0.1761, 0.0, 0.3061))),
        # Where a spring is slack says nothing: one that may be none was certain on a KUKA LWR4.
        (
            JointSpring("hip", 0.0622, -10.0),
            estimates(stiffness=(0.0622, 0.0, 0.164), rest=(-10.0, -10.0, -1.69)),
        ),
        (
            GravityDirection("robot", 0.01, -0.01),
            estimates(roll=(0.01, -0.01, 0.03), pitch=(-0.01, -0.03, 0.01)),
        ),
    ],
)
def test_what_may_be_nothing_is_not_certain(effect: Effect, numbers: dict[str, Estimate]) -> None:
    assert sized(effect, numbers) < CERTAIN


@pytest.mark.parametrize(
    ("effect", "numbers"),
    [
        (CoulombFriction("hip", 0.4), estimates(level=(0.394, 0.169, 0.97))),
        (
            TransmissionEfficiency("hip", 0.8, 0.9),
            estimates(forward_efficiency=(0.8, 0.75, 0.85), backward_efficiency=(0.9, 0.7, 1.0)),
        ),
        # Ten numbers, each of which may be nothing, make a mass that is told.
        (LinkInertia.at("shin"), {}),
    ],
)
def test_one_number_that_is_told_is_enough(effect: Effect, numbers: dict[str, Estimate]) -> None:
    assert sized(effect, numbers) > CERTAIN
