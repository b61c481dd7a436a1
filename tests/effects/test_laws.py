"""Drives, supplies and sums of effects against their definition, written out here once more.

What each effect adds to the torque of a log is asked by plants of their own: see
tests/benchmarks/test_corpus_plants.py.
"""

import numpy as np
import pytest

from tests.effects.needed import motion_of, needed
from tests.sim.random_robots import geared
from wbc import Robot, effects
from wbc.errors import EffectError
from wbc.robot import Motion


@pytest.fixture
def motion(leg: Robot) -> Motion:
    return motion_of(leg)


def test_a_drive_scales_its_report_and_an_offset_comes_on_top(leg: Robot, motion: Motion) -> None:
    constant, offset = effects.TorqueConstant("knee", 1.2), effects.TorqueOffset("knee", -0.7)
    reported = needed(leg.with_effect(constant), motion)
    np.testing.assert_allclose(reported * [1.0, 1.2], needed(leg, motion))
    both = needed(leg.with_effects(offset, constant), motion)
    np.testing.assert_allclose(1.2 * both[:, 1] - 0.7, needed(leg, motion)[:, 1])


def test_a_column_with_a_positive_offset_reads_too_low(leg: Robot, motion: Motion) -> None:
    offset = effects.TorqueOffset("knee", 0.7)
    assert np.all(needed(leg.with_effect(offset), motion)[:, 1] < needed(leg, motion)[:, 1])
    assert "positive offset says that the column reads too low" in offset.explanation


def test_effects_at_one_place_add_up(leg: Robot, motion: Motion) -> None:
    one, two, both = (effects.ViscousFriction("knee", level) for level in (0.1, 0.3, 0.4))
    found, known = needed(leg.with_effects(one, two), motion), needed(leg.with_effect(both), motion)
    np.testing.assert_allclose(found, known, atol=1e-12)


def test_effects_that_this_robot_cannot_have(leg: Robot) -> None:
    with pytest.raises(EffectError, match=r"leaves no mass.*the body has 2 kg"):
        leg.with_effect(effects.PayloadMass("shin", -2.5))
    with pytest.raises(EffectError, match=r"outside \[-20, 1\]"):
        effects.TransmissionEfficiency("knee", 0.9, 1.05)


KT, OHM, GEAR = 0.11, 0.35, 12.0


@pytest.fixture
def wound(leg: Robot) -> Robot:
    return geared(leg, torque_constant=KT, resistance=OHM, gear_ratio=GEAR)


def at_speed(hip: float, knee: float) -> Motion:
    return Motion(np.zeros((1, 2)), np.array([[hip, knee]]))


def test_a_stalled_motor_draws_what_warms_its_winding(leg: Robot, wound: Robot) -> None:
    sag, still = effects.SupplySag("robot", 0.002), at_speed(0.0, 0.0)
    torque = np.array([[0.9, -0.6]])
    heat = OHM * (0.9**2 + 0.6**2) / KT**2
    np.testing.assert_allclose(sag.drive(wound, still, torque), torque * (1.0 - 0.002 * heat))
    # Nothing is known of the winding: only torque times speed can be counted.
    np.testing.assert_array_equal(sag.drive(leg, still, torque), torque)


def test_a_braking_motor_feeds_the_other_before_the_supply_does(wound: Robot) -> None:
    sag, torque = effects.SupplySag("robot", 0.002), np.array([[0.2, -0.2]])
    heat = OHM * 2 * 0.2**2 / KT**2
    for knee, power in ((1.0, 0.2 * GEAR * 2.0 + heat), (50.0, 0.0)):
        drawn = sag.drive(wound, at_speed(3.0, knee), torque)
        np.testing.assert_allclose(drawn, torque * (1.0 - 0.002 * power))


@pytest.mark.parametrize("coefficient", [0.0005, 0.002])
def test_the_reported_torque_is_the_least_that_delivers(coefficient: float, wound: Robot) -> None:
    sag, rng = effects.SupplySag("robot", coefficient), np.random.default_rng(4)
    drives = np.linspace(0.0, 3.0, 300001)[:, None]
    for _ in range(6):
        motion, torque = at_speed(*rng.uniform(-6.0, 6.0, 2)), rng.uniform(-0.7, 0.7, (1, 2))
        along = torque / np.linalg.norm(torque)
        every = Motion(np.zeros((len(drives), 2)), np.repeat(motion.velocity, len(drives), axis=0))
        given = np.linalg.norm(sag.drive(wound, every, drives * along), axis=1)
        enough = int(np.argmax(given > np.linalg.norm(torque)))
        assert enough > 0
        found = sag.drive_inverse(wound, motion, torque)
        np.testing.assert_allclose(found, drives[enough] * along, atol=1e-5)
        np.testing.assert_allclose(sag.drive(wound, motion, found), torque, rtol=1e-9)


def test_the_torque_follows_the_logged_voltage(leg: Robot) -> None:
    effect, change = effects.VoltageScaling("knee", 0.75, 48.0), 0.75 / 4.0
    voltage = np.array([[48.0, 48.0], [48.0, 36.0], [36.0, 60.0], [48.0, np.nan]])
    motion = Motion(*np.zeros((2, 4, 2)), supply_voltage=voltage)
    left = effect.drive(leg, motion, np.ones((4, 2)))
    np.testing.assert_allclose(left.T, [[1.0] * 4, [1.0, 1.0 - change, 1.0 + change, 1.0]])
    np.testing.assert_allclose(effect.drive_inverse(leg, motion, left), np.ones((4, 2)))
