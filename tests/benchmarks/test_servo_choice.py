"""The choice between candidates uses training runs only and finds what it should."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.servo_choice import (
    PROCEDURES,
    Forecasts,
    alike,
    forecasts,
    least,
    outsides,
    simplest,
    stacked,
)

CUTS = [[0, 1], [2, 3], [0, 2], [1, 3]]
SIZES = np.array([2, 5, 3])


def bench() -> tuple[np.ndarray, np.ndarray]:
    """Return positions (3, T, F, 4) and measured (T, 4)."""
    rng = np.random.default_rng(3)
    measured = rng.normal(size=(80, 4)).cumsum(axis=0)
    errors = rng.normal(size=(3, 80, len(outsides(CUTS)), 4)) * np.array([1.0, 0.6, 0.7]).reshape(
        3, 1, 1, 1
    )
    return measured[:, None] + errors, measured


def of_errors(errors: list[list[float]]) -> Forecasts:
    return Forecasts(np.array(errors), np.zeros((1, 3)), np.zeros(1), SIZES)


@pytest.mark.parametrize("fold", range(len(CUTS)))
@pytest.mark.parametrize("procedure", PROCEDURES.values())
def test_the_fold_itself_does_not_enter_its_choice(procedure, fold: int) -> None:
    positions, measured = bench()
    before = procedure(forecasts(positions, measured, CUTS, SIZES, fold))
    positions[:, :, :, CUTS[fold]] = np.nan
    measured[:, CUTS[fold]] = np.nan
    # Nor do the fits that saw it: none but those without it and without one more.
    for place, out in enumerate(outsides(CUTS)):
        if not set(CUTS[fold]) <= set(out):
            positions[:, :, place] = np.nan
    after = procedure(forecasts(positions, measured, CUTS, SIZES, fold))
    np.testing.assert_array_equal(after, before)
    assert before.sum() == pytest.approx(1.0)


def test_stacking_finds_the_shares_of_a_mixture() -> None:
    rng = np.random.default_rng(1)
    rollouts = rng.normal(size=(200, 3))
    shares = np.array([0.25, 0.0, 0.75])
    measured = rollouts @ shares + np.where(np.arange(200) % 5, 0.0, rng.normal(size=200))
    known = Forecasts(np.zeros((3, 2)), rollouts, measured, SIZES)
    np.testing.assert_allclose(stacked(known), shares, atol=1e-6)


def test_stacking_extrapolates_nothing() -> None:
    rollouts = np.array([[1.0, 2.0, 3.0]] * 20)
    known = Forecasts(np.zeros((3, 2)), rollouts, np.full(20, 9.0), SIZES)
    np.testing.assert_allclose(stacked(known), [0.0, 0.0, 1.0], atol=1e-9)


def test_one_standard_error_prefers_fewer_numbers() -> None:
    close = of_errors([[1.4, 1.0, 1.3], [1.2, 0.8, 1.3], [3.0, 3.0, 3.0]])
    assert least(close).tolist() == [0.0, 1.0, 0.0]
    assert simplest(close).tolist() == [1.0, 0.0, 0.0]
    apart = of_errors([[2.0, 1.9, 2.0], [1.2, 0.8, 1.3], [3.0, 3.0, 3.0]])
    assert simplest(apart).tolist() == [0.0, 1.0, 0.0]


def test_those_alike_share_alike() -> None:
    # The first loses on one fold what it wins on another, the last is worse on each.
    known = of_errors([[0.7, 1.5, 1.0], [1.0, 1.0, 1.1], [1.4, 1.4, 1.5]])
    assert alike(known).tolist() == [0.5, 0.5, 0.0]
