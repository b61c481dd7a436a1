"""Log-Cholesky numbers of links against pinocchio, finite differences and the divergence."""

import numpy as np
import pinocchio as pin
import pytest

from wbc.effects import pseudo_inertia

RANDOM = np.random.default_rng(4)
NUMBERS = RANDOM.normal(scale=0.6, size=(5, 10))


def _matrices(numbers: np.ndarray) -> np.ndarray:
    upper = pseudo_inertia.factor(numbers)
    return upper @ upper.swapaxes(-1, -2)


def test_they_are_those_of_pinocchio() -> None:
    for numbers, matrix in zip(NUMBERS, _matrices(NUMBERS), strict=True):
        wanted = pin.LogCholeskyParameters(numbers).toPseudoInertia().toMatrix()
        np.testing.assert_allclose(matrix, wanted, rtol=1e-12, atol=1e-12)


def test_a_matrix_tells_its_numbers() -> None:
    found = pseudo_inertia.numbers_of(_matrices(NUMBERS))
    np.testing.assert_allclose(found, NUMBERS, atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-7, 1e-3, 1.0])
def test_slopes_are_finite_differences(size: float) -> None:
    numbers, step = size * NUMBERS, 1e-6
    for k in range(10):
        more = step * np.eye(10)[k]
        for of, slopes in (
            (_matrices, pseudo_inertia.tangents(numbers)[:, k]),
            (pseudo_inertia.departures, pseudo_inertia.slopes(numbers)[:, :, k]),
        ):
            wanted = (of(numbers + more) - of(numbers - more)) / (2.0 * step)
            np.testing.assert_allclose(slopes, wanted, rtol=1e-4, atol=1e-4)


def test_squares_of_departures_are_the_divergence() -> None:
    squares = np.sum(pseudo_inertia.departures(NUMBERS) ** 2, axis=1)
    wanted = pseudo_inertia.divergence(_matrices(NUMBERS)) / pseudo_inertia.USUAL**2
    np.testing.assert_allclose(squares, wanted, rtol=1e-9)


def test_no_body_is_infinitely_far_from_its_drawing() -> None:
    assert pseudo_inertia.divergence(np.diag([1.0, 1.0, -1e-9, 1.0])) == np.inf


def test_what_is_meant_to_first_order_is_the_body_itself_where_it_is_near() -> None:
    change = 1e-4 * NUMBERS[0]
    np.testing.assert_allclose(pseudo_inertia.of_first_order(change), change, atol=1e-6)
