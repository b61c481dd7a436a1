"""Robots ranked on logs of a plant that shares no code with them."""

from __future__ import annotations

import pytest

from tests.recover.plant import Lane, simulate
from wbc.effects import CoulombFriction, JointSpring, ViscousFriction, load_robot
from wbc.errors import IdentificationError
from wbc.identification import rank_robots
from wbc.measurement import Log

GIVEN = load_robot("planar_leg_fixed").lossless()
TRUE = GIVEN.with_effect(ViscousFriction("knee", 0.5))


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    tables = simulate([Lane({"viscous": (0.0, 0.5)}, 3)], duration=5.0, step=5e-4)
    return [Log(table.pop("time"), table) for table in map(dict, tables)]


def test_the_true_robot_is_best_and_the_others_are_told_from_it(logs: list[Log]) -> None:
    robots = {
        "given": GIVEN,
        "too little": GIVEN.with_effect(ViscousFriction("knee", 0.3)),
        "true": TRUE,
        "almost": TRUE.with_effect(CoulombFriction("hip", 1e-4)),
    }
    ranked = {c.name: c for c in rank_robots(robots, logs)}
    assert {ranked[name].rank for name in ("true", "almost")} == {1, 2}
    assert {ranked[name].standing for name in ("true", "almost")} == {"best", "not distinguishable"}
    assert ranked["true"].error == pytest.approx(1.0, abs=0.25)
    assert ranked["too little"].rank == 3
    assert ranked["given"].standing == "worse"
    assert ranked["given"].difference > 2.0 * ranked["given"].deviation
    assert ranked["almost"].parameters == 2


def test_a_number_at_its_bound_is_said(logs: list[Log]) -> None:
    stiff = GIVEN.with_effect(JointSpring.at("knee", {"stiffness": 0.0, "rest": 0.0}))
    assert rank_robots({"stiff": stiff}, logs)[0].warnings == ()
    end = next(p for p in ViscousFriction.parameters if p.name == "coefficient").high
    extreme = GIVEN.with_effect(ViscousFriction("knee", end))
    assert (
        "coefficient of viscous_friction at knee"
        in rank_robots({"x": extreme}, logs)[0].warnings[0]
    )


def test_robots_that_cannot_be_compared_are_refused(logs: list[Log]) -> None:
    with pytest.raises(IdentificationError, match="no robot"):
        rank_robots({}, logs)
    with pytest.raises(IdentificationError, match="'other' and 'one' have different joints"):
        rank_robots({"one": GIVEN, "other": load_robot("double_pendulum")}, logs)
