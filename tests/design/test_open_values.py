"""What earlier logs leave open of the values of a cause, and what it does to the expected odds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wbc.design.experiment import (
    BAND,
    MotionLimits,
    Predictions,
    Rivals,
    expected,
    parse_cause,
    random_paths,
    tied_rivals,
)
from wbc.effects import CoulombFriction, effect_class, load_robot
from wbc.identification import Diagnosis, diagnose
from wbc.robot import Motion
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
LIMITS = MotionLimits.of(LEG, span=1.0, speed=6.0)
NOISE = np.full(2, 0.2)


def rivals(
    *texts: str, covariances: tuple[np.ndarray | None, ...] = (), noise: float = 0.2
) -> Rivals:
    causes = tuple(parse_cause(text, LEG) for text in texts)
    return Rivals(LEG, causes, np.full(2, noise), covariances=covariances)


def along_a_motion(chosen: Rivals) -> Predictions:
    path = next(random_paths(chosen, LIMITS, 3.0, 1, 1))
    time = path.times(50.0)
    return chosen.predictions(Motion(*path.at(time), time))


def softened(distances: np.ndarray) -> float:
    return float(-4.0 * np.log(np.mean(np.exp(-0.25 * distances))))


FRICTIONS = ("viscous_friction@knee:coefficient=0.1", "coulomb_friction@knee:level=0.2")


def test_the_closed_form_is_the_mean_over_the_open_values() -> None:
    """Brute force: a distance for each of many values, the effects being linear in them."""
    one, other = np.array([[0.03**2]]), np.array([[0.05**2]])
    found = along_a_motion(rivals(*FRICTIONS, covariances=(one, other)))
    spread = float(found.rivals.open_part(0)[0, 0])  # type: ignore[index]
    assert spread < 0.03 / effect_class("viscous_friction").parameters[0].scale
    drawn = []
    for z in np.random.default_rng(1).normal(size=400):
        value = 0.1 + spread * effect_class("viscous_friction").parameters[0].scale * z
        at = replace(
            found.rivals,
            causes=(
                parse_cause(f"viscous_friction@knee:coefficient={value}", LEG),
                found.rivals.causes[1],
            ),
            covariances=(None, other),
        )
        drawn.append(Predictions(at, found.motion, found.links).near_distance((0, 1)))
    assert found.near_distance((0, 1)) == pytest.approx(softened(np.array(drawn)), rel=0.05)
    assert softened(found.distances((0, 1))) == pytest.approx(found.near_distance((0, 1)), rel=0.25)


def test_a_gear_that_may_be_load_friction_is_promised_less() -> None:
    """The first logs leave the efficiencies open: they may be what the rival does."""
    gear = "transmission_efficiency@knee:forward_efficiency=0.8,backward_efficiency=0.7"
    load = "load_friction@knee:coefficient=0.3"
    path = next(random_paths(rivals(gear, load, noise=0.02), LIMITS, 10.0, 1, 1))
    fitted = expected(rivals(gear, load, noise=0.02), LIMITS, path)
    wide = rivals(gear, load, noise=0.02, covariances=(np.diag([0.05**2, 0.05**2]), None))
    averaged = expected(wide, LIMITS, path)
    assert fitted.chance[0, 1] > 0.999
    assert averaged.odds[0, 1] < 0.5 * fitted.odds[0, 1]
    assert averaged.chance[0, 1] < fitted.chance[0, 1]


def test_the_chance_is_how_often_noise_lets_a_run_decide() -> None:
    """Runs with noise, the rival fitted to each: how often do the nats exceed 3?"""
    quiet = along_a_motion(rivals(*FRICTIONS))
    scale = np.sqrt(quiet.distance((0, 1)) / 4.0)  # so that about four nats are expected
    found = along_a_motion(replace(quiet.rivals, noise=NOISE * scale))
    left = found.misfit((0, 1)).ravel()
    noise = np.random.default_rng(0).normal(size=(4000, left.size))
    # Of two fixed predictions that differ by `left`: the ratio of their likelihoods.
    nats = 0.5 * left @ left + noise @ left
    path = next(random_paths(found.rivals, LIMITS, 3.0, 1, 1))
    told = expected(found.rivals, LIMITS, path, rate=50.0)
    assert told.odds[0, 1] == pytest.approx(4.0, rel=0.1)
    assert told.chance[0, 1] == pytest.approx(np.mean(nats > 3.0), abs=0.03)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    logs = record_with(LEG, [CoulombFriction("hip", 0.5)], duration=3.0)
    kinds = [effect_class(n) for n in ("coulomb_friction", "viscous_friction")]
    return diagnose(LEG, logs, kinds)


def test_the_band_is_that_of_the_diagnosis(found: Diagnosis) -> None:
    table = found.to_json()
    assert 3.0 <= table["band"] <= 15.0
    assert tied_rivals(table, LEG, NOISE).band == table["band"]
    assert tied_rivals(table, LEG, NOISE, 4.0).band == 4.0
    assert tied_rivals({**table, "band": None}, LEG, NOISE).band == BAND


def test_a_diagnosis_says_what_it_leaves_open(found: Diagnosis) -> None:
    table: dict[str, Any] = found.to_json()
    chosen = tied_rivals(table, LEG, NOISE)
    own, rival = chosen.covariances
    assert own is not None
    assert rival is not None
    (estimate,) = found.findings[0].parameters.values()
    # Of the intervals without what filters distort.
    assert 0.2 * (estimate.high - estimate.low) < 3.29 * own[0, 0] ** 0.5
    assert 3.29 * own[0, 0] ** 0.5 < 1.3 * (estimate.high - estimate.low)
    older = {**table, "ranking": [{**row, "covariance": None} for row in table["ranking"]]}
    assert tied_rivals(older, LEG, NOISE).covariances == (None, None)
