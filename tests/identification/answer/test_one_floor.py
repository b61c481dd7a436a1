"""A robot's error on logs is one number, whatever it is compared beside."""

from __future__ import annotations

import pytest

from tests.swinging_leg import swing
from wbc import Robot, load_robot
from wbc.effects import CoulombFriction, PayloadMass, RotorInertia
from wbc.identification import compare, rank_robots

BELIEVED = load_robot("planar_leg_fixed")
TRUTH = BELIEVED.lossless().with_effects(CoulombFriction("hip", 0.7), PayloadMass("shin", 0.3))


LOGS = [swing(TRUTH, 1, seconds=5.0), swing(TRUTH, 2, seconds=5.0)]
ROBOTS: dict[str, Robot] = {
    "as described": BELIEVED,
    "lossless": BELIEVED.lossless(),
    "truth": TRUTH,
    "wrong motor": BELIEVED.lossless().with_effect(RotorInertia("knee", 0.05)),
}


def test_the_error_alone_is_that_beside_others() -> None:
    beside = {c.name: c.error for c in rank_robots(ROBOTS, LOGS)}
    reverse = {c.name: c.error for c in rank_robots(dict(reversed(ROBOTS.items())), LOGS)}
    alone = {name: compare(robot, LOGS).error for name, robot in ROBOTS.items()}
    assert beside == pytest.approx(alone, rel=1e-9)
    assert reverse == pytest.approx(alone, rel=1e-9)
    assert min(alone, key=lambda name: alone[name]) == "truth"


def test_a_robot_without_its_effects_is_the_one_before_them() -> None:
    assert TRUTH.without_effects().effects == ()
    masses = [inertia.mass for inertia in TRUTH.without_effects().model.inertias]
    assert masses == [inertia.mass for inertia in BELIEVED.model.inertias]
    more = TRUTH.with_effect(CoulombFriction("knee", 0.1))
    assert more.without_effects() is TRUTH.without_effects()
    assert BELIEVED.without_effects() is BELIEVED
    # What is changed in code after effects were added has no robot before them to go back to.
    heavy = TRUTH.with_gravity((0.0, 0.0, -1.62))
    assert heavy.without_effects().model.gravity.linear[2] == -1.62
