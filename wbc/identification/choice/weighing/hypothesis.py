"""A set of causes with its fit, reduced to what comparing it with others needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.yielding import loose, some_deflect
from wbc.robot import Effect

_IMPOSSIBLE = 6.9  # [nats], one in a thousand

Key = tuple[str, str]
"""Name and place of a cause."""


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
        return max(self.implausible, default=0.0) < _IMPOSSIBLE

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
