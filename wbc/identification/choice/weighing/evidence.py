"""How hypotheses are compared: one number each, in nats. Every decision follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.identification.model.distorted import ALIKE, DISTORTED
from wbc.identification.model.estimation_problem import EstimationProblem

_SIMULATED = 0.02  # ... that simulated links distort
# ... that links which bounce distort: they soon forget how they began. On the practice leg, fits of
# the play alone that began near it left 3.8 to 4.8 %, each in a valley of its own.
_BOUNCING = 0.05


def weigh(problem: EstimationProblem, hypotheses: Sequence[Hypothesis]) -> FloatArray:
    """Return the log evidence of each hypothesis [nats], up to a constant that they share.

    The log density of what is left on held-out data, plus the log prior:

        sum over folds f and outputs o of  n_fo (-1/2 log v_o - 1/2 s_fo / v_o)  +  log prior

    with s_fo the held-out mean square in floors, and v_o the variance that all folds show together,
    never below that of the sensors (1), plus what filters and simulations distort: what leaves less
    in every fold has more density. n_fo counts the independent samples of the fold. What is left is
    autocorrelated; at each output the hypothesis that leaves least there says how much, for all of
    them, or else the differences would mean nothing. What filters distort is the same in all folds:
    with N samples altogether,
    n_fo is divided by 1 + N (a d first)^2 / v, a being the share that may look like one cause.
    Where no sensor measured the forces of contacts, what makes these contacts move is less
    probable, too (`HeldContacts.evidence`).

    Args:
        problem: the logs.
        hypotheses: at least one.
    """
    beside = np.array([h.prior - h.open + h.contacts for h in hypotheses])
    return np.asarray(log_densities(problem, hypotheses).sum(axis=1) + beside)


def left_to_gain(problem: EstimationProblem, h: Hypothesis) -> float:
    """Return what one cause more can add to the log density of a hypothesis at most [nats].

    Where links are simulated, what leaves nothing at all has no more density than what leaves as
    much as the simulation distorts.
    """
    if not h.swings:
        return np.inf
    nothing = np.zeros_like(h.beside)
    best = replace(h, folds=nothing, beside=nothing, samples=problem.white_samples)
    here, there = log_densities(problem, [h, best]).sum(axis=1)
    return float(there - here)


def log_densities(problem: EstimationProblem, hypotheses: Sequence[Hypothesis]) -> FloatArray:
    """Return (n, outputs) the log density of what each hypothesis leaves, without the prior.

    Args:
        problem: the logs.
        hypotheses: at least one.
    """
    reference = min(hypotheses, key=lambda h: h.error)
    least = np.argmin([h.outputs for h in hypotheses], axis=0)
    whiteness = np.array([h.samples for h in hypotheses])[least, np.arange(least.size)]
    samples = reference.rows[:, None] * whiteness
    distorted = problem.distorted(_distorted_share(reference))
    if not reference.swings:
        left = np.maximum(np.min([h.outputs for h in hypotheses], axis=0), 1.0) + distorted
        samples /= 1.0 + samples.sum(axis=0) * ALIKE**2 * distorted / left
    return np.array([_log_density(h, samples, distorted, reference.swings) for h in hypotheses])


def _log_density(
    h: Hypothesis, samples: FloatArray, distorted: FloatArray, simulated: bool
) -> FloatArray:
    if simulated:
        # A simulated link is off by as much in a way of its own: nothing below that is evidence.
        left = np.maximum(h.beside, 1.0 + distorted)
        variance = h.rows @ left / h.rows.sum()
    else:
        left = h.beside
        variance = np.maximum(h.rows @ left / h.rows.sum(), 1.0) + distorted
    return np.asarray(-0.5 * np.sum(samples * (np.log(variance) + left / variance), axis=0))


def _distorted_share(h: Hypothesis) -> float:
    if h.bounces:
        return _BOUNCING
    return _SIMULATED if h.swings else DISTORTED
