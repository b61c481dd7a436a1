"""The noise of sensors and the floor that it makes, on columns whose noise is known."""

from dataclasses import replace

import numpy as np
import pytest

from tests.moved import waving
from tests.recover.plant import recorded
from wbc.dynamics import contact_torque
from wbc.effects import load_robot
from wbc.identification.model.residual import condensed_residual
from wbc.identification.readings import find_repeats
from wbc.identification.records.filters import quantisation_level, steady_level, white_level
from wbc.identification.records.noise import close_repeats, drawn_noise, noise_floor
from wbc.identification.records.preparation import prepare

ROBOT = load_robot("planar_leg_fixed").lossless()


def test_the_jumps_of_dry_friction_are_no_noise_of_the_sensor() -> None:
    """Read off the spectrum the noise was four times too large, and with it the noise floor."""
    random = np.random.default_rng(0)
    t = np.arange(5000) / 100.0
    speed = np.cos(2 * np.pi * 0.9 * t)
    torque = 3.0 * np.sin(2 * np.pi * 0.9 * t) + np.sign(speed)
    noisy = (torque + 0.02 * random.standard_normal(t.size))[:, None]
    true = 0.02**2 / 50.0
    assert white_level(noisy, 100.0)[0] > 10.0 * true
    level = steady_level(noisy, np.sign(speed)[:, None], 100.0)[0]
    assert level == pytest.approx(true, rel=0.15)
    spikes = np.where(random.uniform(size=t.size) < 0.1, 0.1, 0.0)  # these are
    level = steady_level(noisy + spikes[:, None], np.sign(speed)[:, None], 100.0)[0]
    assert level > 2.0 * true


def test_where_no_direction_lasts_nothing_is_said_of_the_noise() -> None:
    shaken = np.where(np.arange(400) % 2, 1.0, -1.0)[:, None]
    assert steady_level(np.ones((400, 1)), shaken, 100.0)[0] == np.inf
    assert steady_level(np.ones((5, 1)), np.ones((5, 1)), 100.0)[0] == np.inf


def test_repeats_are_found_and_their_noise_agrees_with_the_sensors() -> None:
    logs = [recorded()[f"nothing{more}"] for more in ("", " again", ", moved otherwise")]
    records = prepare(ROBOT, logs)
    repeats = close_repeats(records, find_repeats(logs))
    assert repeats == ((0, 1),)
    # Two runs of one excitation that a closed loop answers differently tell no noise.
    assert close_repeats(records, ((0, 1, 2),)) == ((0, 1),)
    residuals = [condensed_residual(ROBOT, [record]) for record in records]
    floor = noise_floor(records, residuals, drawn_noise(records), repeats)
    assert floor.source == "repeats"
    assert floor.values == pytest.approx(np.sqrt(np.diag(floor.sensors)), rel=0.25)
    whitened = np.concatenate(residuals) @ floor.whitening
    assert np.sqrt(np.mean(whitened**2)) == pytest.approx(1.0, abs=0.15)


def test_slow_steps_of_an_encoder_are_noise_at_low_frequencies() -> None:
    rate, step = 500.0, 1e-3
    t = np.arange(20000) / rate
    slow = 0.05 * np.sin(0.3 * t)
    error = np.round(slow / step) * step - slow
    level = quantisation_level(np.round(slow / step)[:, None] * step, rate)[0]
    assert error.var() == pytest.approx(step**2 / 12.0, rel=0.1)
    crossings = 4.0 * 0.05 * 0.3 / (2.0 * np.pi) / step
    assert level == pytest.approx(step**2 / 6.0 / max(crossings, 10.0), rel=0.2)
    noisy = slow + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    assert quantisation_level(noisy[:, None], rate)[0] < 1e-12


def test_a_record_knows_what_its_contacts_push_whatever_their_balls_and_places() -> None:
    """It keeps Jacobians of the points that it has: those of other points are others."""
    robot = load_robot("solo12").lossless()
    (record,) = prepare(robot, [waving(robot)])
    foot, *others = robot.contacts
    for changed in (foot, replace(foot, radius=0.03), replace(foot, offset=foot.offset + 0.05)):
        other = robot.with_contacts((changed, *others))
        pushed = contact_torque(other, record.motion.position, record.forces)
        np.testing.assert_allclose(record.contacts_of(other), pushed, atol=1e-9)
