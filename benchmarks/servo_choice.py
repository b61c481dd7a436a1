"""Choosing between candidates inside the folds: each procedure gives weights to rollouts.

A fold's choice sees the rollouts of its training runs only, each from a fit that had one more
fold of them taken out; the runs of the fold itself do not enter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

_EVERY = 8  # rows of a rollout between two that the stacking sees


class Forecasts(NamedTuple):
    """What the training runs of one fold say about M candidates.

    Attributes:
        errors: (M, J) mean absolute error on each of J folds taken out as well [rad].
        rollouts: (R, M) positions of those runs, thinned [rad].
        measured: (R,) [rad].
        sizes: (M,) numbers that a candidate has; of equal ones the first counts as simpler.
    """

    errors: np.ndarray
    rollouts: np.ndarray
    measured: np.ndarray
    sizes: np.ndarray


def outsides(cuts: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return what each fit of a candidate leaves out: nothing, each fold, each pair of folds."""
    pairs = combinations(cuts, 2)
    return [[], *(list(cut) for cut in cuts), *([*a, *b] for a, b in pairs)]


def forecasts(
    positions: np.ndarray,
    measured: np.ndarray,
    cuts: Sequence[Sequence[int]],
    sizes: np.ndarray,
    fold: int,
) -> Forecasts:
    """Return what is known of the candidates without the runs of `fold`.

    Args:
        positions: (M, T, F, L) rollouts of the fits, in the order of `outsides`, in all L runs.
        measured: (T, L).
        cuts: rows of the runs of each fold.
        sizes: (M,).
        fold: the one left out.
    """
    errors, rollouts, truth = [], [], []
    for place, pair in enumerate(combinations(range(len(cuts)), 2)):
        if fold not in pair:
            continue
        other = pair[0] + pair[1] - fold
        runs = [run for run in cuts[other] if run not in cuts[fold]]
        reached = positions[:, :, 1 + len(cuts) + place, runs]
        errors.append(np.abs(reached - measured[:, runs]).mean(axis=(1, 2)))
        thin = reached[:, ::_EVERY]
        rollouts.append(thin.reshape(len(positions), -1).T)
        truth.append(measured[::_EVERY, runs].ravel())
    return Forecasts(
        np.stack(errors, axis=1), np.concatenate(rollouts), np.concatenate(truth), sizes
    )


def stacked(known: Forecasts) -> np.ndarray:
    """Return the weights >= 0 with sum one whose mean rollout has the least absolute error.

    A linear programme: least sum of slacks that bound the error of every row from both sides.

    Raises:
        RuntimeError: the programme was not solved.
    """
    rows, candidates = known.rollouts.shape
    slack, values = sparse.identity(rows, format="csr"), sparse.csr_matrix(known.rollouts)
    found = linprog(
        np.concatenate([np.zeros(candidates), np.ones(rows)]),
        A_ub=sparse.bmat([[values, -slack], [-values, -slack]], format="csr"),
        b_ub=np.concatenate([known.measured, -known.measured]),
        A_eq=np.concatenate([np.ones(candidates), np.zeros(rows)])[None],
        b_eq=[1.0],
        method="highs",
    )
    if not found.success:
        raise RuntimeError(f"no stacking weights: {found.message}")
    return np.asarray(found.x[:candidates])


def least(known: Forecasts) -> np.ndarray:
    """Return weight one for the candidate of least mean error."""
    return _one(len(known.sizes), int(np.argmin(known.errors.mean(axis=1))))


def simplest(known: Forecasts) -> np.ndarray:
    """Return weight one for the simplest within one standard error of the least mean error."""
    means = known.errors.mean(axis=1)
    best = int(np.argmin(means))
    limit = means[best] + _standard_error(known.errors[best])
    good = np.flatnonzero(means <= limit)
    return _one(len(known.sizes), int(good[np.argmin(known.sizes[good])]))


def alike(known: Forecasts) -> np.ndarray:
    """Return equal weights for all whose mean gap to the best is within its standard error."""
    gaps = known.errors - known.errors[np.argmin(known.errors.mean(axis=1))]
    good = gaps.mean(axis=1) <= np.array([_standard_error(gap) for gap in gaps])
    return np.asarray(good / good.sum())


PROCEDURES: dict[str, Callable[[Forecasts], np.ndarray]] = {
    "stacked": stacked,
    "least inner error": least,
    "simplest in 1 std. error": simplest,
    "mean of those in 1 s. e.": alike,
}


def _one(size: int, place: int) -> np.ndarray:
    weights = np.zeros(size)
    weights[place] = 1.0
    return weights


def _standard_error(values: np.ndarray) -> float:
    return float(values.std(ddof=1) / np.sqrt(values.size))
