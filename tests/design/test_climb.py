"""The climb along slopes: against differences, against the search alone, within the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from wbc.design.experiment import (
    Aim,
    Designed,
    MotionLimits,
    Rivals,
    deciding,
    design_experiment,
    informing,
    parse_cause,
    random_paths,
    shrinking,
)
from wbc.design.experiment.aims import slopes_are_exact
from wbc.design.experiment.climb import _Hill
from wbc.design.experiment.motions import ROOM, Site
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import load_robot
from wbc.robot import Motion

LEG = "planar_leg_fixed"


def site_of(robot: str, texts: Sequence[str], duration: float = 3.0, band: float = 5.0) -> Site:
    model = load_robot(robot).lossless()
    causes = tuple(parse_cause(text, model) for text in texts)
    noise = np.full(model.transmission.size, 0.05)
    limits = MotionLimits.of(model, span=0.5, speed=3.0, acceleration=30.0)
    return Site(Rivals(model, causes, noise, band), limits, duration)


def hill_of(site: Site, aim: Aim) -> tuple[_Hill, np.ndarray]:
    path = next(random_paths(site.rivals, site.limits, site.duration, 3, 1))
    hill = _Hill.of(site, path, aim.climbed, site.rivals.pairs)
    return hill, hill.start(path)


def assert_slopes_are_those_of_differences(site: Site, aim: Aim, weight: float) -> None:
    """Along random directions, through aim, barrier, filter, weights and inverse dynamics."""
    hill, here = hill_of(site, aim)
    _, found = hill.value(here, weight)
    assert found is not None
    slope, random = hill.slope(here, weight, found), np.random.default_rng(0)
    for _ in range(3):
        way = 1e-5 * np.abs(here).max() * random.normal(size=here.size)
        change = 0.5 * (hill.value(here + way, weight)[0] - hill.value(here - way, weight)[0])
        size = np.linalg.norm(slope) * np.linalg.norm(way) / np.sqrt(here.size)
        assert slope @ way == pytest.approx(change, rel=1e-3, abs=1e-3 * size)


@pytest.mark.parametrize(
    ("robot", "texts", "aim"),
    [
        (LEG, ("rotor_inertia@knee", "payload_mass@shin"), deciding),
        (LEG, ("viscous_friction@knee", "transmission_efficiency@knee"), deciding),
        (LEG, ("position_offset@knee", "payload_mass@shin"), deciding),  # another true motion
        (LEG, ("center_of_mass@shin+coulomb_friction@hip",), shrinking),
        (LEG, ("center_of_mass@shin", "coulomb_friction@hip"), informing),
        ("parallelogram_leg", ("rotor_inertia@knee", "payload_mass@shin"), deciding),
        ("emps", ("rotor_inertia@slide", "viscous_friction@slide"), deciding),
        ("staubli_tx40", ("center_of_mass@link_4+payload_mass@link_4",), shrinking),
    ],
)
@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_slopes_are_those_of_differences(
    robot: str, texts: tuple[str, ...], aim: Aim, weight: float
) -> None:
    assert_slopes_are_those_of_differences(site_of(robot, texts), aim, weight)


@pytest.mark.parametrize("open_rival", [False, True])
def test_slopes_hold_where_earlier_logs_leave_values_open(open_rival: bool) -> None:
    site = site_of(LEG, ("viscous_friction@knee", "center_of_mass@shin"))
    rival = np.diag([0.01, 0.02, 0.03]) ** 2 if open_rival else None
    rivals = replace(site.rivals, covariances=(np.array([[0.03**2]]), rival))
    assert_slopes_are_those_of_differences(replace(site, rivals=rivals), deciding, 0.1)


def test_slopes_hold_without_a_band() -> None:
    site = site_of(LEG, ("rotor_inertia@knee", "payload_mass@shin"), band=np.inf)
    assert_slopes_are_those_of_differences(site, deciding, 0.1)


def test_effects_that_remember_have_no_slopes_row_by_row() -> None:
    late = site_of(LEG, ("actuation_delay@knee", "payload_mass@shin"))
    quick = site_of(LEG, ("viscous_friction@knee", "payload_mass@shin"))
    for site, exact in ((late, False), (quick, True)):
        path = next(random_paths(site.rivals, site.limits, 3.0, 3, 1))
        assert slopes_are_exact(site.rivals, site.motion(path, 50.0)) is exact
    one, other = (
        design_experiment(late.rivals, late.limits, 3.0, rounds=4, aim=aim)
        for aim in (deciding, replace(deciding, climbed=None))
    )
    np.testing.assert_array_equal(one.path.sine, other.path.sine)


@pytest.mark.parametrize("duration", [2.0, 4.0, 10.0])
def test_random_motions_hold_a_period_as_far_as_two_hertz_allow(duration: float) -> None:
    site = site_of(LEG, ("rotor_inertia@knee",), duration)
    for path in random_paths(site.rivals, site.limits, duration, 0, 6):
        assert path.frequency >= min(1.0 / duration, 0.4)
        assert path.frequency * path.sine.shape[1] <= 2.0 + 1e-9


def planned(site: Site, aim: Aim, climb: bool) -> Designed:
    aim = aim if climb else replace(aim, climbed=None)
    return design_experiment(site.rivals, site.limits, site.duration, rounds=15, aim=aim)


@pytest.mark.parametrize(
    ("texts", "aim"),
    [
        (("rotor_inertia@knee", "payload_mass@shin"), deciding),
        (("viscous_friction@knee", "coulomb_friction@knee"), deciding),
        (("center_of_mass@shin+payload_mass@shin",), shrinking),
    ],
)
def test_a_climb_is_never_worse_than_the_search_alone_and_keeps_the_limits(
    texts: tuple[str, ...], aim: Aim
) -> None:
    site = site_of(LEG, texts)
    alone, climbed = planned(site, aim, False), planned(site, aim, True)
    values = [
        aim(site.rivals.predictions(site.motion(one.path, 100.0)), site.rivals.pairs)
        for one in (alone, climbed)
    ]
    assert values[1] > values[0]
    if aim is shrinking:  # what is judged is what was climbed
        assert climbed.width == pytest.approx(np.exp(-values[1]))
    assert_within(site, climbed)
    again = planned(site, aim, True)
    np.testing.assert_array_equal(again.path.sine, climbed.path.sine)
    np.testing.assert_array_equal(again.path.cosine, climbed.path.cosine)


def assert_within(site: Site, found: Designed) -> None:
    """On a fine grid, with the torques of every cause."""
    limits, robot = site.limits, site.rivals.robot
    q, v, a = found.path.at(np.linspace(0.0, site.duration, 3001))
    kept = ROOM + 0.01  # compared on a grid of 50 Hz
    assert np.all(q - limits.center <= kept * (limits.high - limits.center))
    assert np.all(limits.center - q <= kept * (limits.center - limits.low))
    assert np.all(np.abs(v) <= kept * limits.speed)
    assert np.all(np.abs(a) <= kept * limits.acceleration)
    for cause in ((), *site.rivals.causes):
        with_cause, motion = robot.with_effects(*cause), Motion(q, v, a)
        torque = rotor_torque(with_cause, motion, link_torque(with_cause, motion))[0]
        assert np.all(np.abs(torque) <= kept * limits.torque)
