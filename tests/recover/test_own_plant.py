"""Flaws of a closed-form plant, alone, together and outside the list, found from short logs."""

import re
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
import pytest

from tests.recover.plant import Lane, as_log, simulate
from wbc.effects import load_robot
from wbc.identification import Diagnosis, diagnose

LEG = load_robot("planar_leg_fixed").lossless()
WEDGE = 2.0 - 1.0 / 0.9
Cases = dict[str, tuple[dict[str, Any], dict[str, dict[str, float]]]]
CASES: Cases = {
    "payload and friction": (
        {"foot_mass": 0.1, "coulomb": (0.0, 0.3)},
        {"payload_mass@foot": {"mass": 0.1}, "coulomb_friction@knee": {"level": 0.3}},
    ),
    "efficiency and spring": (
        {"eta_f": (0.9, 1.0), "eta_b": (WEDGE, 1.0), "spring": (0.0, 1.0), "rest": 0.2},
        {
            "transmission_efficiency@hip": {"forward_efficiency": 0.9},
            "joint_spring@knee": {"stiffness": 1.0, "rest": 0.2},
        },
    ),
    "both torque constants": (
        {"torque_factor": 1.12},
        {"torque_constant@hip": {"factor": 1.12}, "torque_constant@knee": {"factor": 1.12}},
    ),
    "delay": (
        {"delay": 0.006},
        {"actuation_delay@hip": {"delay": 0.006}, "actuation_delay@knee": {"delay": 0.006}},
    ),
    "short presliding": (
        {"hysteresis": (0.0, 0.4), "hysteresis_rate": 40.0},
        {"presliding@knee": {"level": 0.4, "length": 0.025}},
    ),
    "centre of mass": ({"shin_shift": 0.02}, {"center_of_mass@shin": {"z": -0.02}}),
    "current limit": ({"current_limit": (8.0, np.inf)}, {"current_limit@hip": {"limit": 8.0}}),
}
WAY = {"forward_efficiency": 0.8, "backward_efficiency": 0.75, "length": 0.03}
LOSSES: Cases = {
    "losses over a way": (
        {"eta_f": (1.0, 0.8), "eta_b": (1.0, 0.75), "bent_length": (0.0, 0.03)},
        {"load_presliding@knee": WAY},
    ),
    "losses near rest": (
        {"slow_share": (0.0, 0.3), "slow_speed": 0.8},
        {"load_stribeck_friction@knee": {"coefficient": 0.3, "speed": 0.8}},
    ),
}
UNKNOWN = {
    "coupling": {"coupling": 0.4},
    "friction that grows with position": {"position_friction": (0.0, 0.8)},
}
# Friction that is gone at 0.3 rad/s; speeds go up to 4 rad/s.
NEAR_REST = {
    "friction near rest": ({"stribeck": (0.0, 0.1), "stribeck_speed": 0.15}, set()),
    "Coulomb friction, and at the other joint near rest": (
        {"coulomb": (1.0, 0.0), "stribeck": (0.0, 0.1), "stribeck_speed": 0.15},
        {("coulomb_friction", "hip")},
    ),
}
RUNS = 2
# Near rest again with other noise, which hides it.
NOISY = (60, 110)
BESIDE_UNKNOWN = {"eta_f": (1.0, 0.75), "eta_b": (1.0, 0.7), "position_friction": (0.0, 0.5)}


def lanes_of(flaw: dict[str, Any], noise: int) -> list[Lane]:
    """Return the runs of one robot."""
    return [Lane(flaw, excitation=30 + run, noise=noise + run) for run in range(RUNS)]


def drives(follows: bool) -> list[Lane]:
    """Return a run on a supply that falls by 2 % a second and one on a nearly empty battery.

    A drive that does not follow its supply has a wrong torque constant instead, in both runs.
    """
    wrong: dict[str, Any] = {"torque_factor": (1.0, 0.85)}
    falling = {"fading": (0.0, 0.02)} if follows else wrong
    return [Lane(falling, excitation=30, noise=90), Lane(wrong, excitation=31, noise=91)]


@cache
def tables() -> dict[str, list[dict[str, np.ndarray]]]:
    """Return the tables of all cases: all lanes together take hardly longer than those of one."""
    flaws = {name: flaw for name, (flaw, _) in (CASES | NEAR_REST).items()} | UNKNOWN
    lanes = {name: lanes_of(flaw, 10 * k) for k, (name, flaw) in enumerate(flaws.items())}
    lanes |= {name: lanes_of(flaw, 70) for name, (flaw, _) in LOSSES.items()}
    near_rest, _ = NEAR_REST["friction near rest"]
    lanes |= {f"noise {noise}": lanes_of(near_rest, noise) for noise in NOISY}
    lanes |= {f"follows {follows}": drives(follows) for follows in (True, False)}
    lanes["losses beside unknown"] = lanes_of(BESIDE_UNKNOWN, 95)
    made = iter(simulate([lane for runs in lanes.values() for lane in runs], 6.0, step=4e-4))
    return {name: list(islice(made, RUNS)) for name in lanes}


@cache
def diagnosed(name: str) -> Diagnosis:
    """Return the diagnosis of a case, made when a test first asks: tests run in two processes."""
    return diagnose(LEG, [as_log(table) for table in tables()[name]])


@pytest.mark.parametrize("name", CASES | LOSSES)
def test_what_was_hidden_is_found_where_it_was_hidden(name: str) -> None:
    diagnosis, truth = diagnosed(name), (CASES | LOSSES)[name][1]
    assert diagnosis.verdict == "named"
    found = {f"{effect.name}@{effect.where}": effect.values for effect in diagnosis.effects}
    assert found.keys() == truth.keys()
    for place, values in truth.items():
        for parameter, value in values.items():
            assert found[place][parameter] == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize("name", NEAR_REST)
def test_friction_that_is_gone_at_usual_speeds_is_found(name: str) -> None:
    diagnosis, others = diagnosed(name), NEAR_REST[name][1]
    certain = any(finding.probability >= 0.95 for finding in diagnosis.findings)
    assert diagnosis.verdict == ("named" if certain else "ambiguous")  # 0.94 where it is alone
    assert all(finding.probability > 0.9 for finding in diagnosis.findings)
    found = {(effect.name, effect.where): effect.values for effect in diagnosis.effects}
    assert found.keys() == others | {("stribeck_friction", "knee")}
    assert found["stribeck_friction", "knee"]["level"] == pytest.approx(0.1, rel=0.4)
    assert found["stribeck_friction", "knee"]["speed"] == pytest.approx(0.15, rel=0.3)


@pytest.mark.parametrize("noise", NOISY)
def test_friction_near_rest_that_noise_hides_is_taken_for_nothing_else(noise: int) -> None:
    """It was a ripple of 250 periods per turn, or something unknown, that was named before."""
    diagnosis = diagnosed(f"noise {noise}")
    found = {(effect.name, effect.where) for effect in diagnosis.effects}
    # What predicts stays in the model to use, also where its name is doubted.
    believed = all(finding.probability >= 0.5 for finding in diagnosis.findings)
    assert diagnosis.verdict == (("named" if believed else "unknown") if found else "none")
    assert found <= {("stribeck_friction", "knee")}


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_is_outside_the_list_is_called_unknown(name: str) -> None:
    diagnosis = diagnosed(name)
    assert diagnosis.verdict == "unknown"
    assert re.search("(times|far above) the noise floor", diagnosis.remainder)


def test_the_error_falls_with_every_cause_added() -> None:
    for name in ("payload and friction", "efficiency and spring"):
        errors = [step.error for step in diagnosed(name).steps]
        assert errors == sorted(errors, reverse=True)
        assert errors[-1] < 1.3


@pytest.mark.parametrize(
    ("follows", "name", "values"),
    [
        (True, "voltage_scaling", {"share": 1.0, "nominal": 48.0}),
        (False, "torque_constant", {"factor": 0.85}),
    ],
)
def test_a_drive_that_follows_its_supply_is_told_from_a_wrong_constant(
    follows: bool, name: str, values: dict[str, float]
) -> None:
    logs = [as_log(table) for table in tables()[f"follows {follows}"]]
    for k, share in enumerate((1.0 - 0.02 * logs[0].time, 0.85 * np.ones(len(logs[1])))):
        logs[k] = logs[k].with_columns({f"{j}.voltage": 48.0 * share for j in ("hip", "knee")})
    diagnosis = diagnose(LEG, logs)
    assert diagnosis.verdict == "named"
    (found,) = diagnosis.effects
    assert found.key == (name, "knee")
    assert found.values == pytest.approx(values, rel=0.03)


def test_losses_under_load_are_named_beside_something_unknown() -> None:
    """They were left out, and Coulomb friction of 1.6 N m stood in their place."""
    diagnosis = diagnosed("losses beside unknown")
    assert diagnosis.verdict == "unknown"
    found = {effect.key: effect.values for effect in diagnosis.effects}
    losses = found["transmission_efficiency", "knee"]
    assert losses["forward_efficiency"] == pytest.approx(0.75, abs=0.02)
    assert losses["backward_efficiency"] == pytest.approx(0.7, abs=0.02)
