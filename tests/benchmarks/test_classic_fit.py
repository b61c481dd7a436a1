"""The standard error of a ratio of two residuals on the same rows."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.classic_fit import ratio_error


def test_the_error_of_a_ratio_is_that_of_repeated_logs() -> None:
    """Beside the spread over logs drawn anew: one output shares its rows' noise, one does not."""
    rng, blocks = np.random.default_rng(1), np.repeat(np.arange(60), 10)

    def log() -> tuple[np.ndarray, np.ndarray]:
        # Rows of a block leave the same: 60 independent values, not 600.
        one, other, own = (np.repeat(rng.normal(size=(60, 2)), 10, axis=0) for _ in range(3))
        return one, np.column_stack([one[:, 0] + 0.1 * own[:, 0], other[:, 1]])

    ratios = []
    for _ in range(400):
        left, other = log()
        ratios.append(np.sqrt(np.mean(left**2, axis=0) / np.mean(other**2, axis=0)))
    told = np.mean([ratio_error(*log(), blocks) for _ in range(40)], axis=0)
    assert told == pytest.approx(np.std(ratios, axis=0), rel=0.15)
    assert told[0] < told[1] / 5
