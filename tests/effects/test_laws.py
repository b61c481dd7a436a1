"""Each effect against its definition, written out here once more, in the torques that logs need."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.effects.needed import motion_of, needed
from tests.sim.random_robots import geared
from wbc import Robot, effects
from wbc.arrays import FloatArray
from wbc.dynamics import link_torque
from wbc.errors import EffectError
from wbc.robot import Effect, Motion

REFLECTED = 0.02666666666666667
Law = Callable[[FloatArray, FloatArray, FloatArray], FloatArray | float]


def gauss(x: FloatArray) -> FloatArray:
    return np.exp(-(x**2))


# What an effect at the knee adds to the torque at the output of its motor, for q, v and a.
ADDED: list[tuple[Effect, Law]] = [
    (effects.ViscousFriction("knee", 0.4), lambda q, v, a: 0.4 * v),
    # at 60 C
    (effects.ThermalViscousFriction("knee", 0.4, 0.03), lambda q, v, a: 0.4 * np.exp(-0.6) * v),
    (effects.CoulombFriction("knee", 0.6), lambda q, v, a: 0.6 * np.sign(v)),
    (effects.StribeckFriction("knee", 0.5, 0.2), lambda q, v, a: 0.5 * gauss(v / 0.2) * np.sign(v)),
    (effects.QuadraticDrag("knee", 0.3), lambda q, v, a: 0.3 * v * np.abs(v)),
    (effects.JointSpring("knee", 3.0, 0.25), lambda q, v, a: 3.0 * (q - 0.25)),
    (effects.TorqueRipple("knee", 0.4, 7.0, 0.3), lambda q, v, a: -0.4 * np.sin(7.0 * q + 0.3)),
    (effects.TorqueOffset("knee", -0.7), lambda q, v, a: 0.7),
    (effects.RotorInertia("knee", 0.08), lambda q, v, a: (0.08 - REFLECTED) * a),
]


@pytest.fixture
def motion(leg: Robot) -> Motion:
    return motion_of(leg)


@pytest.mark.parametrize(("effect", "law"), ADDED, ids=[effect.name for effect, _ in ADDED])
def test_torque_that_an_effect_adds(leg: Robot, motion: Motion, effect: Effect, law: Law) -> None:
    more = needed(leg.with_effect(effect), motion) - needed(leg, motion)
    q, v, a = (x[:, 1] for x in (motion.position, motion.velocity, motion.acceleration))
    np.testing.assert_allclose(more[:, 1], law(q, v, a), atol=1e-12)
    np.testing.assert_allclose(more[:, 0], 0.0, atol=1e-12)


def test_losses_of_a_gear_depend_on_the_direction_of_power(leg: Robot, motion: Motion) -> None:
    output, speed = link_torque(leg, motion)[:, 1], motion.velocity[:, 1]
    rotor = REFLECTED * motion.acceleration[:, 1]
    forward = output * speed > 0.0
    assert 0 < forward.sum() < len(forward)
    share = 0.5 * gauss(speed / 0.8)
    for effect, lifts, lowers in (
        (effects.TransmissionEfficiency("knee", 0.75, 0.5), 0.75, 2.0),
        (effects.LoadFriction("knee", 0.15), 0.85, 1.15),
        (effects.LoadStribeckFriction("knee", 0.5, 0.8), 1.0 - share, 1.0 + share),
    ):
        found = needed(leg.with_effect(effect), motion)[:, 1]
        expected = output / np.where(forward, lifts, lowers) + rotor
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_drive_scales_its_report_and_an_offset_comes_on_top(leg: Robot, motion: Motion) -> None:
    constant, offset = effects.TorqueConstant("knee", 1.2), effects.TorqueOffset("knee", -0.7)
    reported = needed(leg.with_effect(constant), motion)
    np.testing.assert_allclose(reported * [1.0, 1.2], needed(leg, motion))
    both = needed(leg.with_effects(offset, constant), motion)
    np.testing.assert_allclose(1.2 * both[:, 1] - 0.7, needed(leg, motion)[:, 1])


def test_a_payload_is_a_point_mass_at_its_place(leg: Robot) -> None:
    still = Motion(np.array([[0.3, 0.5]]), np.zeros((1, 2)), np.zeros((1, 2)))
    base = link_torque(leg, still)[0]
    for where, arm in (("shin", 0.2), ("foot", 0.4)):
        more = link_torque(leg.with_effect(effects.PayloadMass(where, 0.9)), still)[0] - base
        # Gravity on a point `arm` along the shin; positive angles swing the leg to -x.
        knee = 0.9 * 9.81 * arm * np.sin(0.8)
        np.testing.assert_allclose(more, [knee + 0.9 * 9.81 * 0.4 * np.sin(0.3), knee])
    inertia = leg.with_effect(effects.PayloadMass("foot", 0.9)).model.inertias[2]
    about_knee = inertia.inertia[1, 1] + inertia.mass * inertia.lever[2] ** 2
    assert about_knee == pytest.approx(2.0 * 0.4**2 / 3 + 0.9 * 0.4**2)


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
