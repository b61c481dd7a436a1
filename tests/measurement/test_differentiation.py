from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import savgol_coeffs

from wbc.errors import LogError
from wbc.measurement import (
    filtered_derivatives,
    fuse_motion,
    local_polynomial_operator,
    low_pass,
    weak_operator,
)


def _stamps(rows: int, seed: int) -> np.ndarray:
    """Return jittered stamps, 500 Hz on average."""
    rng = np.random.default_rng(seed)
    return np.arange(rows) * 0.002 + rng.uniform(-7e-4, 7e-4, rows)


def _motion(time: np.ndarray) -> list[np.ndarray]:
    w = np.array([5.0, 9.0])
    x = time[:, None] * w + [0.0, 1.0]
    scale = np.array([1.0, 0.4])
    return [(scale * np.sin(x)).sum(1) + 5.0, (scale * w * np.cos(x)).sum(1),
            -(scale * w**2 * np.sin(x)).sum(1)]  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    degree=st.integers(1, 5),
    coefficients=st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6),
)
def test_local_polynomials_are_exact_on_polynomials(
    seed: int, degree: int, coefficients: list[float]
) -> None:
    time = _stamps(80, seed)
    polynomial = np.polynomial.Polynomial(coefficients[: degree + 1])
    for derivative in range(min(degree, 2) + 1):
        operator = local_polynomial_operator(time, 0.03, degree, derivative)
        expected = polynomial.deriv(derivative)(time) if derivative else polynomial(time)
        scale = 10.0 ** (-11 + 3 * derivative)
        np.testing.assert_allclose(operator @ polynomial(time), expected, atol=10 * scale)


def test_a_uniform_window_gives_the_classic_savitzky_golay_shape() -> None:
    time = np.arange(60) * 0.01
    row = local_polynomial_operator(time, 0.05, 3, 1).toarray()[30]
    assert np.count_nonzero(row) == 5
    # Five points and four parameters leave one residual direction; weights cannot change
    # the antisymmetric part, which two odd powers through two pairs fix.
    np.testing.assert_allclose(row[28:33], savgol_coeffs(5, 3, 1, 0.01, use="dot"), atol=1e-8)


def test_a_window_that_is_too_short_is_refused() -> None:
    with pytest.raises(LogError, match=r"holds 3 of 60 samples.*needs at least 0\.05 s"):
        local_polynomial_operator(np.arange(60) * 0.01, 0.02, 3)


def test_derivatives_of_a_jittered_noisy_motion() -> None:
    time = _stamps(5000, 3)
    rng = np.random.default_rng(0)
    position, velocity, acceleration = _motion(time)
    q = position + 2e-5 * rng.normal(size=time.size)
    v = velocity + 3e-3 * rng.normal(size=time.size)
    inner = slice(100, -100)
    naive = np.gradient(np.gradient(q, time), time)
    filtered = filtered_derivatives(time, q, 12.0).second
    fused = fuse_motion(time, q, 12.0, position_noise=2e-5, velocity=v, velocity_noise=3e-3)
    alone = fuse_motion(time, q, 12.0, position_noise=2e-5)
    level = np.std(acceleration)
    assert np.std((naive - acceleration)[inner]) > 0.1 * level
    assert np.std((filtered - acceleration)[inner]) < 1e-3 * level
    assert np.std((fused.acceleration - acceleration)[inner]) < 1e-3 * level
    fused_error = np.std((fused.velocity - velocity)[inner])
    assert fused_error < np.std((alone.velocity - velocity)[inner])
    assert fused_error < 0.2 * 3e-3
    # The three are one motion: the integral of the acceleration is the velocity.
    integral = np.concatenate(
        [[0.0], np.cumsum(0.5 * np.diff(time) * (fused.acceleration[1:] + fused.acceleration[:-1]))]
    )
    drift = fused.velocity - fused.velocity[0] - integral
    assert np.abs(drift).max() < 1e-2


@pytest.mark.parametrize("smoother", ["spline", "butterworth"])
def test_smoothers_halve_the_amplitude_at_the_cutoff_without_phase(smoother: str) -> None:
    time = _stamps(6000, 1)
    for frequency, low, high in ((1.0, 0.99, 1.01), (10.0, 0.49, 0.51), (40.0, -0.01, 0.01)):
        wave = np.stack(
            [np.sin(2 * np.pi * frequency * time), np.cos(2 * np.pi * frequency * time)], 1
        )
        if smoother == "spline":
            out = fuse_motion(time, wave, 10.0, position_noise=1.0).position
        else:
            out = low_pass(time, wave, 10.0)
        inner = slice(1000, -1000)
        gain = out[inner].T @ wave[inner] / (0.5 * wave[inner].shape[0])
        assert low < gain[0, 0] < high
        assert abs(gain[0, 1]) < 0.01


@pytest.mark.parametrize("cutoff", [0.01, 240.0])
def test_cutoffs_outside_the_log_are_refused(cutoff: float) -> None:
    time = np.arange(2000) * 0.002
    with pytest.raises(LogError, match="outside what this log allows"):
        low_pass(time, time, cutoff)
    with pytest.raises(LogError, match="outside what this log allows"):
        fuse_motion(time, time, cutoff, position_noise=1.0)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), overlap=st.floats(0.0, 0.9), width=st.floats(0.05, 0.5))
def test_weak_form_differentiates_parabolas_exactly_on_any_stamps(
    seed: int, overlap: float, width: float
) -> None:
    time = _stamps(600, seed)
    weak = weak_operator(time, width, overlap)
    y, dy = 7.0 - 3.0 * time + 2.0 * time**2, -3.0 + 4.0 * time
    np.testing.assert_allclose(-(weak.dphi @ y), weak.phi @ dy, atol=1e-8)
    np.testing.assert_allclose(weak.ddphi @ y, 4.0, atol=1e-6)
    np.testing.assert_allclose(weak.phi @ np.ones(600), 1.0, atol=1e-12)


def test_weak_form_moves_derivatives_off_a_measured_motion() -> None:
    time = _stamps(5000, 5)
    position, velocity, acceleration = _motion(time)
    weak = weak_operator(time, 0.3, 0.75)
    level = np.std(weak.phi @ acceleration)
    assert np.std(weak.phi @ velocity + weak.dphi @ position) < 1e-5 * np.std(velocity)
    assert np.std(weak.phi @ acceleration - weak.ddphi @ position) < 1e-4 * level
    spacing = np.diff(weak.centres)
    np.testing.assert_allclose(spacing, 0.25 * 0.3, rtol=1e-9)
    assert weak.phi.shape == weak.dphi.shape == (weak.centres.size, time.size)
    assert weak.phi.nnz < 0.05 * weak.phi.shape[0] * weak.phi.shape[1]


def test_weak_form_passes_over_gaps_and_refuses_supports_that_do_not_fit() -> None:
    time = np.concatenate([np.arange(500) * 0.002, 3.0 + np.arange(500) * 0.002])
    weak = weak_operator(time, 0.2, 0.5)
    assert not np.any((weak.centres > 1.1) & (weak.centres < 2.9))
    with pytest.raises(LogError, match="8 samples"):
        weak_operator(time, 0.01)
    with pytest.raises(LogError, match="overlap"):
        weak_operator(time, 0.2, 1.0)
