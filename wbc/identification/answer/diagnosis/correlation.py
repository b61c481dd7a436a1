"""Which fitted numbers move together: what logs know of their sum only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import bootstrap_steps

_BLOCKS_PER_PARAMETER = 4  # fewer resampled blocks are correlated by chance


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlations of the parameters found, over refits on blocks drawn from the logs.

    Attributes:
        names: (effect, where, parameter) of each.
        matrix: (p, p), ones on the diagonal; zero beside a parameter that no refit moves. Empty
            where there are too few blocks to tell.
    """

    names: tuple[tuple[str, str, str], ...]
    matrix: FloatArray


def correlation_of(problem: EstimationProblem, fit: Fit) -> Correlation:
    """Return how the parameters of a fit move together."""
    names = tuple((*fit.effects[k].key, parameter.name) for k, parameter in fit.parameters)
    count = len(names)
    if count < 2 or np.unique(problem.blocks).size < _BLOCKS_PER_PARAMETER * count:
        return Correlation(names, np.zeros((0, 0)))
    steps = bootstrap_steps(fit, problem.blocks)
    moving = np.std(steps, axis=0) > 0.0
    matrix = np.eye(count)
    matrix[np.ix_(moving, moving)] = np.atleast_2d(np.corrcoef(steps[:, moving].T))
    return Correlation(names, matrix)
