"""Fits taken in step against a solver that takes them one by one."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from wbc.identification.servo import FitStart, lockstep_fit

TIME = np.linspace(0.0, 3.0, 60)
DATA = 2.0 * np.exp(-1.3 * TIME) + 0.4 + 0.02 * np.sin(40.0 * TIME)
DATA[7] += 1.5


ROWS = [np.ones(60, dtype=bool), TIME < 1.5, TIME > 0.4]


def residuals(points: np.ndarray, tasks: Sequence[int]) -> np.ndarray:
    size, rate, rest = points.T[:, :, None]
    seen = np.array(ROWS)[list(tasks)]  # What a task does not see need not be a number.
    return np.where(seen, size * np.exp(-rate * TIME) + rest - DATA, np.nan)


def test_finds_the_minima_of_the_loss_within_the_bounds() -> None:
    first, scale, soft = np.array([1.0, 0.5, 0.1]), np.array([1.0, 1.0, 0.3]), 0.05
    for high in ([9.0, 9.0, 9.0], [9.0, 1.0, 9.0]):
        bounds = np.array([0.0, 0.1, 0.0]), np.array(high)
        pull = np.full(3, 0.02), first
        found = lockstep_fit(
            residuals, [FitStart(first, row) for row in ROWS], bounds, scale, pull, soft, 60
        )
        for task, (x, cost) in enumerate(found):

            def full(x: np.ndarray, task: int = task) -> np.ndarray:
                return np.concatenate(
                    [residuals(x[None], [task])[0][ROWS[task]], 0.02 * (x - first)]
                )

            truth = least_squares(
                full, first, bounds=bounds, loss="soft_l1", f_scale=soft, xtol=1e-12, ftol=1e-12
            )
            assert cost <= truth.cost * (1.0 + 1e-4)
            np.testing.assert_allclose(x, truth.x, atol=5e-3)
            assert np.all(x <= bounds[1])
