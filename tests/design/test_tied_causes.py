"""Rivals from a saved diagnosis: which they are, what logs leave open of their values, the odds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.design.rivals import LEG, LIMITS, rivals
from wbc.design.experiment import (
    BAND,
    Predictions,
    Rivals,
    design_experiment,
    expected,
    informing,
    parameter_names,
    parse_cause,
    random_paths,
    shrinking,
    tied_causes,
    tied_rivals,
)
from wbc.effects import CoulombFriction, effect_class
from wbc.errors import DesignError
from wbc.identification import Diagnosis, diagnose
from wbc.robot import Motion
from wbc.sim.excitation import record_with

NOISE = np.full(2, 0.2)


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
    found = along_a_motion(rivals(*FRICTIONS, covariances=(one, other), noise=0.2))
    scale = effect_class("viscous_friction").parameters[0].scale
    spread = float(found.rivals.open_part(0)[0, 0])  # type: ignore[index]
    assert spread < 0.03 / scale
    drawn = []
    for z in np.random.default_rng(1).normal(size=400):
        cause = parse_cause(f"viscous_friction@knee:coefficient={0.1 + spread * scale * z}", LEG)
        causes = (cause, found.rivals.causes[1])
        at = replace(found.rivals, causes=causes, covariances=(None, other))
        drawn.append(Predictions(at, found.motion, found.links).near_distance((0, 1)))
    assert found.near_distance((0, 1)) == pytest.approx(softened(np.array(drawn)), rel=0.05)
    assert softened(found.distances((0, 1))) == pytest.approx(found.near_distance((0, 1)), rel=0.25)


def test_a_gear_that_may_be_load_friction_is_promised_less() -> None:
    """The first logs leave the efficiencies open: they may be what the rival does."""
    gear = "transmission_efficiency@knee:forward_efficiency=0.8,backward_efficiency=0.7"
    load = "load_friction@knee:coefficient=0.3"
    sure = rivals(gear, load, noise=0.02)
    path = next(random_paths(sure, LIMITS, 10.0, 1, 1))
    wide = replace(sure, covariances=(np.diag([0.05**2, 0.05**2]), None))
    fitted, averaged = (expected(chosen, LIMITS, path) for chosen in (sure, wide))
    assert fitted.chance[0, 1] > 0.999
    assert averaged.odds[0, 1] < 0.5 * fitted.odds[0, 1]
    assert averaged.chance[0, 1] < fitted.chance[0, 1]


def test_the_chance_is_how_often_noise_lets_a_run_decide() -> None:
    """Runs with noise, the rival fitted to each: how often do the nats exceed 3?"""
    quiet = along_a_motion(rivals(*FRICTIONS, noise=0.2))
    scale = np.sqrt(quiet.distance((0, 1)) / 4.0)  # so that about four nats are expected
    found = along_a_motion(replace(quiet.rivals, noise=NOISE * scale))
    left = found.misfit((0, 1)).ravel()
    # Of two fixed predictions that differ by `left`: the ratio of their likelihoods.
    nats = 0.5 * left @ left + np.random.default_rng(0).normal(size=(4000, left.size)) @ left
    path = next(random_paths(found.rivals, LIMITS, 3.0, 1, 1))
    told = expected(found.rivals, LIMITS, path, rate=50.0)
    assert told.odds[0, 1] == pytest.approx(4.0, rel=0.1)
    assert told.chance[0, 1] == pytest.approx(np.mean(nats > 3.0), abs=0.03)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    logs = record_with(LEG, [CoulombFriction("hip", 0.5)], duration=3.0)
    kinds = [effect_class(n) for n in ("coulomb_friction", "viscous_friction")]
    return diagnose(LEG, logs, kinds)


def effect(name: str, where: str, **values: float) -> dict[str, Any]:
    return {"effect": name, "where": [where], "parameters": values}


def diagnosis(**changes: Any) -> dict[str, Any]:
    own = effect("coulomb_friction", "hip", level=0.5)
    other = effect("viscous_friction", "hip", coefficient=0.2)
    row = {"added": [1], "removed": [1], "standing": "not distinguishable", "effects": [other]}
    return {"verdict": "ambiguous", "effects": [own], "ranking": [row], **changes}


def test_a_special_case_does_not_hide_what_a_motion_can_tell() -> None:
    """Load friction is a gear with two efficiencies; told apart in one direction only."""
    chosen = rivals(
        "transmission_efficiency@knee:forward_efficiency=0.8,backward_efficiency=0.75",
        "load_friction@knee:coefficient=0.22",
    )
    found = design_experiment(chosen, LIMITS, 3.0, rounds=12)
    assert found.alike == ((1, 0),)
    assert found.worst == found.odds[0, 1]
    chance = [expected(chosen, LIMITS, p).odds[0, 1] for p in random_paths(chosen, LIMITS, 3, 1, 9)]
    assert found.worst > np.median(chance)


def test_causes_that_no_motion_tells_apart_are_refused() -> None:
    """A tilted base and a wrong zero of the first joint are one on a leg in a vertical plane."""
    chosen = rivals("gravity_direction@robot:pitch=0.05,roll=0", "position_offset@hip:offset=0.05")
    with pytest.raises(DesignError, match="no motion of this robot tells"):
        design_experiment(chosen, LIMITS, 3.0, rounds=2)


def test_the_cheap_distance_is_the_refitted_one_where_effects_are_linear() -> None:
    names = ("viscous_friction@knee", "coulomb_friction@knee", "rotor_inertia@hip")
    found = along_a_motion(rivals(*names))
    for pair in found.rivals.pairs:
        assert found.near_distance(pair) == pytest.approx(found.distance(pair), rel=1e-4)


def test_a_diagnosis_says_its_band_and_what_it_leaves_open(found: Diagnosis) -> None:
    table: dict[str, Any] = found.to_json()
    assert 3.0 <= table["band"] <= 15.0
    chosen = tied_rivals(table, LEG, NOISE)
    assert chosen.band == table["band"]
    assert tied_rivals(table, LEG, NOISE, 4.0).band == 4.0
    own, rival = chosen.covariances
    assert rival is not None
    (estimate,) = found.findings[0].parameters.values()
    # Of the intervals without what filters distort.
    share = 3.29 * own[0, 0] ** 0.5 / (estimate.high - estimate.low)
    assert 0.2 < share < 1.3
    rows = [{**row, "covariance": None} for row in table["ranking"]]
    older = tied_rivals({**table, "band": None, "ranking": rows}, LEG, NOISE)
    assert (older.band, older.covariances) == (BAND, (None, None))


def test_rivals_are_the_ties_or_the_closest() -> None:
    given = diagnosis()
    found, rival = tied_causes(given, LEG)
    assert found == (CoulombFriction("hip", level=0.5),)
    assert rival[0].values == {"coefficient": 0.2}
    (row,) = given["ranking"]
    rows = [{**row, "standing": "worse"}]
    rows.append({**rows[0], "effects": [effect("torque_offset", "hip", offset=0.1)]})
    _, rival = tied_causes(diagnosis(ranking=rows), LEG)
    assert rival[0].name == "viscous_friction"
    with pytest.raises(DesignError, match="holds no rival"):
        tied_causes(diagnosis(ranking=[]), LEG)
    soft = effect("joint_compliance", "knee", stiffness=900.0, damping=2.0)
    with pytest.raises(DesignError, match="soft or loose gear"):
        tied_causes(diagnosis(ranking=[{**row, "effects": [soft]}]), LEG)


def test_one_cause_alone_gets_the_motion_that_shrinks_its_intervals() -> None:
    chosen = rivals("center_of_mass@shin+payload_mass@shin+rotor_inertia@knee")
    drawn = [expected(chosen, LIMITS, p) for p in random_paths(chosen, LIMITS, 4.0, 1, 9)]
    classic = design_experiment(chosen, LIMITS, 4.0, rounds=16, aim=informing)
    ours = design_experiment(chosen, LIMITS, 4.0, rounds=16, aim=shrinking, starts=[classic.path])
    widths = np.array([one.widths[0] for one in drawn])
    said = np.array([p.scale for _, p in parameter_names(chosen.causes[0])]) * 1.645
    assert ours.widths[0][1] == pytest.approx(said[1])  # nothing moves along y: as known before
    assert np.all(np.delete(ours.widths[0] / said, 1) < 0.1)
    assert np.mean(np.log(ours.widths[0])) < np.mean(np.log(np.median(widths, axis=0)))
    # Compared at half the rate of the log.
    assert np.mean(np.log(ours.widths[0])) <= np.mean(np.log(classic.widths[0])) + 0.01
