"""Hypotheses: sets of causes, fitted, and the one number in nats by which they are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.intervals import ALIKE, DISTORTED
from wbc.identification.model.yielding import loose, some_deflect
from wbc.robot import Effect

Key = tuple[str, str]
"""Name and place of a cause."""

Offer = tuple[Effect, ...]
"""Effects with start values, not yet fitted."""

_IMPOSSIBLE = 6.9  # [nats], one in a thousand
_SIMULATED = 0.02  # share of the first error (rms) that simulated links distort
# ... and that links which bounce distort: they soon forget how they began. On the practice leg,
# fits of the play alone that began near it left 3.8 to 4.8 %, each in a valley of its own.
_BOUNCING = 0.05


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes, fitted; light enough that every one that was tried can be kept.

    Attributes:
        effects: the causes with fitted parameters, in the order in which they act.
        folds: (F, outputs) held-out mean squares of each fold, in floors.
        beside: (F, outputs) the same beside what is open of numbers that are drawn to a prior.
        open: what these numbers cost, being open while a fold is left out [nats].
        blocks: (B,) held-out mean squares of each block, all outputs together.
        samples: (outputs,) independent samples per row of what this hypothesis leaves.
        rows: (F,) rows of each fold.
        asked: what its names, places and numbers cost [nats].
        implausible: what each effect's numbers cost that no machine is likely to have [nats].
        untold: how many numbers of each effect what is usual tells, not the logs.
        contacts: by how much it is more probable that contacts hold, whose forces no sensor
            measured [nats].
        squares: (B, outputs) mean squares of each block in the outputs' units, held out, or of the
            fit itself where they are larger: where it did not reach its end, it leaves more than a
            step further would leave held out.
        whole: whether it is fitted to its end, with derivatives of its own.
    """

    effects: tuple[Effect, ...]
    folds: FloatArray
    beside: FloatArray
    open: float
    blocks: FloatArray
    samples: FloatArray
    rows: FloatArray
    asked: float
    implausible: tuple[float, ...]
    untold: tuple[float, ...] = ()
    contacts: float = 0.0
    squares: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    whole: bool = True

    @property
    def prior(self) -> float:
        """Log prior [nats]."""
        return -self.asked - sum(self.implausible)

    @property
    def believable(self) -> bool:
        """Whether no cause is less likely than one in a thousand before the logs speak.

        Where much is left that no hypothesis explains, logs speak for any number that takes up a
        part of it, however impossible, and such causes hide others.
        """
        return len(self.likely) == len(self.effects)

    @property
    def likely(self) -> Offer:
        """The causes that are not less likely than one in a thousand before the logs speak."""
        pairs = zip(self.effects, self.implausible, strict=True)
        return tuple(effect for effect, cost in pairs if cost < _IMPOSSIBLE)

    @property
    def outputs(self) -> FloatArray:
        """(outputs,) held-out mean squares, in floors."""
        return np.asarray(self.rows @ self.folds / self.rows.sum())

    @property
    def error(self) -> float:
        """Held-out mean square in floors, all outputs together."""
        return float(self.outputs.mean())

    @property
    def keys(self) -> tuple[Key, ...]:
        """Names and places of the causes."""
        return tuple(effect.key for effect in self.effects)

    def begun(self, effects: Sequence[Effect]) -> Offer:
        """Return effects with the numbers that this hypothesis has for them."""
        own = {effect.key: effect for effect in self.effects}
        return tuple(own.get(effect.key, effect) for effect in effects)

    def only_noise(self, problem: EstimationProblem) -> bool:
        """Whether no output is left with more than what no two models are told apart by."""
        return bool(np.all(self.squares.mean(axis=0) <= problem.indistinct))

    @property
    def swings(self) -> bool:
        """Whether links were simulated behind their gears."""
        return some_deflect(self.effects)

    @property
    def bounces(self) -> bool:
        """Whether one of these links has play."""
        return loose(self.effects)


def fold_means(folds: IntArray, squares: FloatArray) -> FloatArray:
    """Return (F, outputs) the mean of squares (rows, outputs) over each fold."""
    _, index = np.unique(folds, return_inverse=True)
    sums = np.stack([np.bincount(index, column) for column in squares.T], axis=1)
    return np.asarray(sums / np.bincount(index)[:, None])


def without(effects: Sequence[Effect], *dropped: Effect) -> tuple[Effect, ...]:
    """Return the effects but those given."""
    keys = {effect.key for effect in dropped}
    return tuple(effect for effect in effects if effect.key not in keys)


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
