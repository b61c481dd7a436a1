"""Robots ranked on logs of a plant that shares no code with them; one error per robot."""

from __future__ import annotations

import pytest

from tests.recover.plant import dragging_knee
from tests.swinging_leg import swing
from wbc import Robot
from wbc.effects import (
    CoulombFriction,
    JointSpring,
    PayloadMass,
    RotorInertia,
    ViscousFriction,
    load_robot,
)
from wbc.errors import IdentificationError
from wbc.identification import Ranked, compare, rank_robots
from wbc.measurement import Log

GIVEN = load_robot("planar_leg_fixed").lossless()
TRUE = GIVEN.with_effect(ViscousFriction("knee", 0.5))


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    return [dragging_knee()]


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


EFFICIENCY, FRICTION = ("transmission_efficiency", "knee"), ("coulomb_friction", "hip")


@pytest.mark.parametrize(
    ("added", "removed", "difference", "standing", "judgement"),
    [
        ((), (), 0.0, "found", "kept"),  # it holds no effect: the robot as given
        ((FRICTION,), (), -0.1, "worse", "no gain beyond chance"),
        ((FRICTION,), (), -3.0, "worse", "fits better, but less probable"),
        ((), (FRICTION,), 3.0, "worse", "fits worse"),
        ((FRICTION,), (EFFICIENCY,), 0.1, "worse", "fits as well, but less probable"),
        ((FRICTION,), (EFFICIENCY,), 0.1, "not distinguishable", "as good"),
        ((FRICTION,), (), -3.0, "better", "more probable"),
    ],
)
def test_a_model_that_fits_equally_is_not_called_worse(
    added: tuple, removed: tuple, difference: float, standing: str, judgement: str
) -> None:
    row = Ranked(added, removed, 2.0, difference, 0.1, -5.0, standing)
    assert row.judgement == judgement
