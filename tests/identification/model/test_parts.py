"""The pieces of the diagnosis against brute force, known noise and an ODE solver."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.recover.plant import Lane, dragging_knee, recorded
from wbc.effects import load_robot
from wbc.effects.position_torques import strongest_orders
from wbc.errors import IdentificationError, LogError
from wbc.identification import compare, diagnose
from wbc.identification.choice.design_matrix import DesignMatrix
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.filters import steady_level, white_level
from wbc.identification.records.noise import close_repeats, drawn_noise, noise_floor
from wbc.identification.records.preparation import prepare
from wbc.measurement import Log, find_repeats, low_pass


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    return recorded(Lane({}, 1, noise=0), Lane({}, 1, noise=1), Lane({}, 2, noise=2))


ROBOT = load_robot("planar_leg_fixed").lossless()


@pytest.mark.parametrize("shape", [(300,), (300, 2), (300, 2, 3), (7, 2)])
@pytest.mark.parametrize("order", [2, 6])
def test_the_low_pass_is_that_of_scipy(shape: tuple[int, ...], order: int) -> None:
    values = np.random.default_rng(0).standard_normal(shape)
    sections = butter(order, 8.0 / 250.0, output="sos")
    padding = min(len(values) - 1, int(3.0 * 500.0 / 8.0))
    expected = sosfiltfilt(sections, values, axis=0, padlen=padding)
    np.testing.assert_allclose(low_pass(values, 8.0, 500.0, order), expected, rtol=1e-9, atol=1e-9)


def test_white_noise_is_measured_below_a_large_motion() -> None:
    random = np.random.default_rng(0)
    t = np.arange(5000) / 500.0
    motion = np.sin(2 * np.pi * 0.7 * t) + 2e-3 * random.standard_normal(t.size)
    level = white_level(motion[:, None], 500.0)[0]
    assert level == pytest.approx(2e-3**2 / 250.0, rel=0.15)


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


def test_no_direction_that_lasts_says_nothing_of_the_noise() -> None:
    shaken = np.where(np.arange(400) % 2, 1.0, -1.0)[:, None]
    assert steady_level(np.ones((400, 1)), shaken, 100.0)[0] == np.inf
    assert steady_level(np.ones((5, 1)), np.ones((5, 1)), 100.0)[0] == np.inf


def test_held_out_errors_equal_those_of_separate_fits() -> None:
    random = np.random.default_rng(1)
    columns = random.standard_normal((60, 2, 3))
    residual = random.standard_normal((60, 2)) + columns[:, :, 0]
    folds = np.repeat([0, 1, 2], 20)
    matrix = DesignMatrix.from_rows(columns, residual, folds)
    squares = 0.0
    for fold in range(3):
        train, test = folds != fold, folds == fold
        a, b = columns[train].reshape(-1, 3), residual[train].ravel()
        x = np.linalg.lstsq(a, b, rcond=None)[0]
        squares += np.sum((residual[test].ravel() - columns[test].reshape(-1, 3) @ x) ** 2)
    assert matrix.held_out([0, 1, 2]) == pytest.approx(squares / residual.size, rel=1e-3)


def test_a_cause_of_fixed_size_is_expected_where_one_fold_alone_shows_it() -> None:
    random = np.random.default_rng(3)
    folds = np.repeat([0, 1, 2], 20)
    columns = np.zeros((60, 1, 1))
    columns[50:55] = 5.0  # a limit that was reached once
    residual = columns[..., 0] + 0.1 * random.standard_normal((60, 1))
    without = DesignMatrix.from_rows(columns, residual, folds)
    with_it = DesignMatrix.from_rows(columns, residual, folds, np.ones(1))
    assert without.held_out([0]) == pytest.approx(np.mean(residual**2), rel=0.01)
    assert with_it.held_out([0]) < 0.02


def test_what_two_columns_explain_is_what_a_fit_of_both_does() -> None:
    random = np.random.default_rng(2)
    columns = random.standard_normal((60, 2, 5))
    columns[..., 1] = columns[..., 0] + 1e-2 * columns[..., 1]  # of which the difference counts
    residual = random.standard_normal((60, 2)) + 50.0 * (columns[..., 0] - columns[..., 1])
    matrix = DesignMatrix.from_rows(columns, residual, np.repeat([0, 1, 2], 20))
    gains, r = matrix.gains_of_two(3, [3, 4]), residual.ravel()

    def left(chosen: list[int]) -> float:
        a = columns[..., chosen].reshape(-1, len(chosen))
        return float(np.sum((r - a @ np.linalg.lstsq(a, r, rcond=None)[0]) ** 2))

    for one, other in ((0, 1), (0, 2), (1, 2)):
        assert gains[one, other] == pytest.approx(left([3, 4]) - left([one, other, 3, 4]), rel=1e-6)


def test_repeats_are_found_and_their_noise_agrees_with_the_sensors(logs: list[Log]) -> None:
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


def test_a_comparison_says_which_joint_fails_and_what_it_follows() -> None:
    comparison = compare(ROBOT, [dragging_knee()])
    ratios = {output.output: output.ratio for output in comparison.outputs}
    assert ratios["knee"] > 10.0 * ratios["hip"]
    assert (comparison.where[0].output, comparison.where[0].variable) == ("knee", "speed")
    assert comparison.where[0].share > 0.95
    assert json.loads(json.dumps(comparison.to_json()))["error"] == comparison.error


@pytest.mark.parametrize("seed", range(8))
def test_where_a_joint_rests_long_is_no_period(seed: int) -> None:
    random = np.random.default_rng(seed)
    rests = np.repeat(random.uniform(-1.2, 1.2, 5), 800)
    position = np.concatenate([np.linspace(-1.2, 1.2, 2000), rests])
    torque = np.sin(5.0 * position + random.uniform(0.0, 6.0))
    torque += 0.1 * random.standard_normal(torque.size)
    assert strongest_orders([position], [torque])[0] == pytest.approx(5.0, abs=0.3)


def test_logs_that_say_nothing_are_refused(logs: list[Log]) -> None:
    with pytest.raises(IdentificationError, match="no log"):
        diagnose(ROBOT, [])
    with pytest.raises(IdentificationError, match="too short"):
        diagnose(ROBOT, [logs[0].between(0.0, 0.3)])
    without = logs[0].select([n for n in logs[0].names if "torque" not in n])
    with pytest.raises(LogError, match="no torque of joint 'hip'"):
        compare(ROBOT, [without])
    free = load_robot("planar_leg").lossless()
    base = {f"base_{axis}.position": np.zeros(len(logs[0])) for axis in ("x", "z", "pitch")}
    with pytest.raises(IdentificationError, match="contact forces"):
        compare(free, [logs[0].with_columns(base)])
