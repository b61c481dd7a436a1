"""Filters and derivatives, held against polynomials, SciPy and exact motions."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import butter, sosfiltfilt

from wbc.measurement import derivative, low_pass
from wbc.measurement.filters import local_polynomial_operator, residual_noise


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    degree=st.integers(1, 5),
    coefficients=st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6),
)
def test_local_polynomials_are_exact_on_polynomials(
    seed: int, degree: int, coefficients: list[float]
) -> None:
    jitter = np.random.default_rng(seed).uniform(-7e-4, 7e-4, 80)
    time = np.arange(80) * 0.002 + jitter
    polynomial = np.polynomial.Polynomial(coefficients[: degree + 1])
    for times in range(min(degree, 2) + 1):
        operator = local_polynomial_operator(time, degree, times)
        expected = polynomial.deriv(times)(time) if times else polynomial(time)
        scale = 10.0 ** (-11 + 3 * times)
        np.testing.assert_allclose(operator @ polynomial(time), expected, atol=10 * scale)


@pytest.mark.parametrize("shape", [(300,), (300, 2), (300, 2, 3), (7, 2)])
@pytest.mark.parametrize("order", [2, 6])
def test_the_low_pass_is_that_of_scipy(shape: tuple[int, ...], order: int) -> None:
    values = np.random.default_rng(0).standard_normal(shape)
    sections = butter(order, 8.0 / 250.0, output="sos")
    padding = min(len(values) - 1, int(3.0 * 500.0 / 8.0))
    expected = sosfiltfilt(sections, values, axis=0, padlen=padding)
    np.testing.assert_allclose(low_pass(values, 8.0, 500.0, order), expected, rtol=1e-9, atol=1e-9)


def test_derivatives_of_a_noisy_motion() -> None:
    rate, w, size = 500.0, np.array([5.0, 9.0]), np.array([1.0, 0.4])
    wave = size * np.sin(np.arange(5000)[:, None] / rate * w + [0.0, 1.0])
    acceleration = -(wave @ w**2)
    q = wave.sum(axis=1) + 5.0 + 2e-5 * np.random.default_rng(0).normal(size=5000)
    filtered = derivative(derivative(low_pass(q, 12.0, rate, 4), rate), rate)
    missed = (filtered - acceleration)[100:-100]
    assert np.std(missed) < 1e-3 * np.std(acceleration)  # differences alone: more than a tenth


def test_residual_noise_ignores_motion_and_single_steps() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(4000) * 0.002 + rng.uniform(-5e-4, 5e-4, 4000)
    smooth = 3.0 * np.sin(8.0 * time)
    assert residual_noise(time, smooth) < 1e-5
    noisy = smooth + 0.01 * rng.normal(size=time.size)
    assert residual_noise(time, noisy) == pytest.approx(0.01, rel=0.08)
    assert residual_noise(time, noisy + 5.0 * (time > 4.0)) == pytest.approx(0.01, rel=0.08)
