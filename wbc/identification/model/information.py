"""What logs and prior know of some parameters of a fit while the others are free."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray

# Added to a diagonal of ones, so that parameters that repeat one another can be solved for.
_RIDGE = 1e-9


def scaled(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an information matrix (p, p) with ones on its diagonal, and the sizes (p,) taken out.

    It can be solved where parameters repeat one another.
    """
    size = np.sqrt(np.maximum(np.diagonal(information), 1e-300))
    return information / np.outer(size, size) + _RIDGE * np.eye(size.size), size


def beside_others(information: FloatArray, rows: Sequence[int]) -> FloatArray:
    """Return (k, k) the information about some parameters while all others are free to move.

    Args:
        information: (p, p) about all parameters, in squared standard deviations.
        rows: the k parameters.
    """
    chosen = np.array(rows, dtype=np.intp)
    others = np.setdiff1d(np.arange(len(information)), chosen)
    own = information[np.ix_(chosen, chosen)]
    if not others.size:
        return own
    beside, size = scaled(information[np.ix_(others, others)])
    across = information[np.ix_(others, chosen)] / size[:, None]
    return np.asarray(own - across.T @ np.linalg.solve(beside, across))
