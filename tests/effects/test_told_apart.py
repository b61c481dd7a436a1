"""Effects that are much alike: what tells them apart, and what no log can show of them."""

import numpy as np
import pytest

from wbc import Robot, effects, load_robot
from wbc.effects.friction import RotorCoulombFriction
from wbc.identification import diagnose
from wbc.measurement import Log
from wbc.robot import Effect, Motion
from wbc.sim.excitation import ENCODER, record_run, record_with

COLD, WARM, RATIO = 20.0, 60.0, 20.0


def logs_of(leg: Robot, effect: Effect, temperatures: list[float | None]) -> list[Log]:
    real, logs = leg.with_effect(effect), []
    for k, degrees in enumerate(temperatures):
        warm = None if degrees is None else np.full(2, degrees)
        logs.append(ENCODER.measure(real, record_run(real, leg, 7 + k // 2, 3.0, warm), k))
    return logs


BY_WARMTH = (effects.ThermalViscousFriction("knee", 0.6, 0.03), [COLD, WARM, COLD, 40.0])
BY_DIRECTION = (effects.DirectionalViscousFriction("hip", 0.6, 0.2), [None, None, None])


@pytest.mark.parametrize(("effect", "temperatures"), [BY_WARMTH, BY_DIRECTION])
def test_friction_that_differs_is_named_with_its_numbers(
    leg: Robot, effect: Effect, temperatures: list[float | None]
) -> None:
    diagnosis = diagnose(leg, logs_of(leg, effect, temperatures))
    assert diagnosis.verdict == "named"
    (found,) = diagnosis.effects
    assert found.key == effect.key
    assert found.values == pytest.approx(effect.values, rel=0.02)


def test_friction_alike_in_both_directions_is_plain_viscous_friction(leg: Robot) -> None:
    """With one number more it does as well; until it cost a name, every answer was tied."""
    logs = record_with(leg, [effects.ViscousFriction("knee", 0.3)], duration=6.0)
    found = diagnose(leg, logs)
    assert found.verdict == "named"
    (one,) = found.findings
    assert (one.effect.key, one.rivals) == (("viscous_friction", "knee"), ())


@pytest.mark.parametrize("kind", [effects.CoulombFriction, RotorCoulombFriction])
def test_a_gear_with_losses_tells_on_which_side_of_it_friction_is(
    leg: Robot, kind: type[effects.CoulombFriction | RotorCoulombFriction]
) -> None:
    lossy = load_robot("planar_leg_fixed")
    real, loss = lossy.with_effect(kind("knee", 0.8)), effects.TransmissionEfficiency
    logs = [ENCODER.measure(real, record_run(real, leg, seed, 4.0), seed) for seed in (7, 8)]
    for given, losses in ((lossy, set()), (leg, {(loss.name, "hip"), (loss.name, "knee")})):
        found = diagnose(given, logs, [loss, effects.CoulombFriction, RotorCoulombFriction])
        assert {effect.key for effect in found.effects} == {(kind.name, "knee"), *losses}


SWING = np.linspace([-1.0, 0.1], [1.0, 1.0], 50)
SAME = Motion(SWING, SWING, temperature=np.full((50, 2), 40.0))
WARMER = SAME.replace(temperature=np.full((50, 2), 50.0))
THERMAL = effects.ThermalViscousFriction("knee", 0.4, 0.03)


def travel(way: float) -> Motion:
    return Motion(np.linspace([0.4, 0.4], [0.4, 0.4 + way], 50), np.zeros((50, 2)))


@pytest.mark.parametrize(
    ("effect", "motions", "known"),
    [
        (THERMAL, [SAME], False),
        (THERMAL, [SAME.replace(temperature=None)], False),
        (THERMAL, [SAME, WARMER], True),
        (effects.DirectionalViscousFriction("hip", 0.4, 0.1), [SAME], True),
        (effects.DirectionalViscousFriction("knee", 0.4, 0.1), [SAME], False),
        # A ripple shows from one period on, and a spring where its joint moves.
        (effects.TorqueRipple("knee", 1.0, 5.0, 0.0), [travel(1.0)], False),
        (effects.TorqueRipple("knee", 1.0, 7.0, 0.0), [travel(1.0)], True),
        (effects.JointSpring("knee", 1000.0, 0.5), [travel(1e-4)], False),
        (effects.JointSpring("knee", 1000.0, 0.5), [travel(0.1)], True),
    ],
)
def test_what_these_motions_can_show(
    leg: Robot, effect: Effect, motions: list[Motion], known: bool
) -> None:
    assert effect.search.recognisable(effect, leg, motions) is known


def test_a_wave_of_the_rotor_is_more_certain_than_one_beside_it(leg: Robot) -> None:
    certain, remarks = {}, {}
    for order in (2.0 * RATIO, 2.3 * RATIO):
        ripple = effects.TorqueRipple("knee", 0.1, order, 0.5)
        diagnosis = diagnose(leg, record_with(leg, [ripple], duration=3.0), [effects.TorqueRipple])
        (finding,) = diagnosis.findings
        assert finding.effect.values["order"] == pytest.approx(order, rel=0.01)
        certain[order] = finding.probability
        remarks[order] = finding.effect.search.remarks(finding.effect, leg)
    # With orders alike on any scale it was 0.80 and 0.77.
    assert certain[2.0 * RATIO] > certain[2.3 * RATIO] + 0.1
    assert remarks[2.0 * RATIO] == ("This is 2 per turn of the rotor.",)
    assert remarks[2.3 * RATIO] == ()
