"""Logs of the planar leg from an independent plant: what was hidden must be found."""

import pytest

from tests.outside import outside
from wbc.effects import load_robot
from wbc.identification import Diagnosis, diagnose
from wbc.measurement import load_logs


def run(case: str, runs: str = "?") -> Diagnosis:
    robot = load_robot("planar_leg" if case.startswith("float") else "planar_leg_fixed")
    paths = sorted(outside("practice_leg").glob(f"{case}{runs}.csv"))
    return diagnose(robot.lossless(), load_logs(paths))


NAMED = {
    "case01": {
        ("transmission_efficiency", "hip"): {"forward_efficiency": 0.85},
        ("transmission_efficiency", "knee"): {"forward_efficiency": 0.75},
    },
    "case02": {("coulomb_friction", "hip"): {"level": 0.7}},
    "case03": {("viscous_friction", "knee"): {"coefficient": 0.4}},
    "case04": {("rotor_inertia", "hip"): {"reflected_inertia": 0.08}},
    "case05": {("payload_mass", "foot"): {"mass": 0.3}},
    "case06": {("joint_spring", "hip"): {"stiffness": 3.0, "rest": 0.3}},
    "case07": {("torque_ripple", "knee"): {"amplitude": 0.6, "order": 40.0}},
    "case08": {
        ("coulomb_friction", "knee"): {"level": 0.7},
        ("rotor_inertia", "hip"): {"reflected_inertia": 0.06666666666666668},
        ("rotor_inertia", "knee"): {"reflected_inertia": 0.06666666666666668},
    },
    # The plant's hysteresis is Dahl's: friction with memory.
    "case10": {("presliding", "hip"): {"level": 0.6}, ("presliding", "knee"): {"level": 0.6}},
    "float01": {("transmission_efficiency", "knee"): {"forward_efficiency": 0.78}},
    "float02": {("payload_mass", "base"): {"mass": 1.2}},
    "float03": {("coulomb_friction", "hip"): {"level": 1.5}},
}


@pytest.mark.parametrize("case", NAMED)
def test_the_hidden_effect_of_the_leg_is_named_and_measured(case: str) -> None:
    floats = case.startswith("float")
    diagnosis = run(case, "?" if floats else "[ac]")  # b repeats a, d is as c
    assert diagnosis.verdict == "named"
    findings = {finding.effect.key: finding for finding in diagnosis.findings}
    assert {name for name, _ in findings} == {name for name, _ in NAMED[case]}
    assert floats or findings.keys() == NAMED[case].keys()
    for key, values in NAMED[case].items():
        for name, truth in values.items():
            estimate = findings[key].parameters[name]
            assert estimate.value == pytest.approx(truth, rel=0.005)
            # One in ten 90 % intervals misses by right; none may miss by its own width.
            half = 0.5 * (estimate.high - estimate.low)
            assert estimate.low - half <= truth <= estimate.high + half
    assert diagnosis.error.after < 1.2


def test_play_is_found_by_simulating_the_link_behind_it() -> None:
    diagnosis = run("case09", "a")
    assert diagnosis.verdict == "named"
    # A bouncing link is simulated roughly: what else it may leave room for is not certain.
    certain = {f.effect.key: f.effect for f in diagnosis.findings if f.probability >= 0.95}
    # One integrator for all links gives 0.0403 to 0.0414; the one for a single link gave 1 %.
    assert certain["backlash", "knee"].values["width"] == pytest.approx(0.04, rel=0.04)
    assert diagnosis.error.after < 0.05 * diagnosis.error.before


@pytest.mark.parametrize("case", ["case00", "float00"])
def test_a_leg_without_hidden_effect_is_left_alone(case: str) -> None:
    diagnosis = run(case)
    assert diagnosis.verdict == "none"
    assert diagnosis.effects == ()


def test_a_force_sensor_that_reads_too_little_is_no_payload() -> None:
    logs = [
        log.with_columns({n: 0.97 * log.column(n) for n in log.names if n.startswith("foot.force")})
        for log in load_logs(sorted(outside("practice_leg").glob("float00?.csv")))
    ]
    diagnosis = diagnose(load_robot("planar_leg").lossless(), logs)
    assert diagnosis.verdict == "named"
    (effect,) = diagnosis.effects
    assert effect.key == ("force_sensor_gain", "foot")
    assert effect.values["gain"] == pytest.approx(0.97, rel=0.001)
