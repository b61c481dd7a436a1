"""Fits taken in step against a solver that takes them one by one."""

import numpy as np
from scipy.optimize import least_squares

from wbc.identification.lockstep_fit import Task, lockstep_fit

TIME = np.linspace(0.0, 3.0, 60)
DATA = 2.0 * np.exp(-1.3 * TIME) + 0.4 + 0.02 * np.sin(40.0 * TIME)
DATA[7] += 1.5


def residuals(points: np.ndarray) -> np.ndarray:
    size, rate, rest = points.T[:, :, None]
    return size * np.exp(-rate * TIME) + rest - DATA


def test_finds_the_minima_of_the_loss_within_the_bounds() -> None:
    rows = [np.ones(60, dtype=bool), TIME < 1.5, TIME > 0.4]
    first, scale, soft = np.array([1.0, 0.5, 0.1]), np.array([1.0, 1.0, 0.3]), 0.05
    for high in ([9.0, 9.0, 9.0], [9.0, 1.0, 9.0]):
        bounds = np.array([0.0, 0.1, 0.0]), np.array(high)
        pull = np.full(3, 0.02), first
        found = lockstep_fit(
            residuals, [Task(first, row) for row in rows], bounds, scale, pull, soft, 60
        )
        for (x, cost), row in zip(found, rows, strict=True):

            def full(x: np.ndarray, row: np.ndarray = row) -> np.ndarray:
                return np.concatenate([residuals(x[None])[0][row], 0.02 * (x - first)])

            truth = least_squares(
                full, first, bounds=bounds, loss="soft_l1", f_scale=soft, xtol=1e-12, ftol=1e-12
            )
            assert cost <= truth.cost * (1.0 + 1e-4)
            np.testing.assert_allclose(x, truth.x, atol=5e-3)
            assert np.all(x <= bounds[1])
