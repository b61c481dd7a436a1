"""The compiled linear solver against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.mechanics.linear import factor, solve_factored


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 8, 11, 32, 67])
def test_factors_solve_a_system(size: int) -> None:
    rng = np.random.default_rng(size)
    matrix, right = rng.normal(size=(size, size)), rng.normal(size=size)
    matrix[0, 0] = 0.0 if size > 1 else 1.0  # the first pivot must be looked for
    factors, pivots, found = matrix.copy(), np.zeros(size, dtype=np.int64), right.copy()
    assert factor(factors, pivots)
    solve_factored(factors, pivots, found)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("size", [1, 4, 6, 9])
def test_a_singular_matrix_is_told(size: int) -> None:
    matrix = np.ones((size, size)) if size > 1 else np.zeros((1, 1))
    assert not factor(matrix, np.zeros(size, dtype=np.int64))
