from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import savgol_coeffs

from wbc.errors import LogError
from wbc.measurement import derivative, low_pass
from wbc.measurement.filters import local_polynomial_operator


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
    for times in range(min(degree, 2) + 1):
        operator = local_polynomial_operator(time, 0.03, degree, times)
        expected = polynomial.deriv(times)(time) if times else polynomial(time)
        scale = 10.0 ** (-11 + 3 * times)
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


def test_derivatives_of_a_noisy_motion() -> None:
    rate = 500.0
    time = np.arange(5000) / rate
    rng = np.random.default_rng(0)
    position, _, acceleration = _motion(time)
    q = position + 2e-5 * rng.normal(size=time.size)
    inner = slice(100, -100)
    naive = np.gradient(np.gradient(q, time), time)
    filtered = derivative(derivative(low_pass(q, 12.0, rate, 4), rate), rate)
    level = np.std(acceleration)
    assert np.std((naive - acceleration)[inner]) > 0.1 * level
    assert np.std((filtered - acceleration)[inner]) < 1e-3 * level
