"""A set of causes with its fit, and how much it asks one to believe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.model.fit import Fit
from wbc.robot import Effect


@dataclass(frozen=True, eq=False)
class Model:
    """A set of causes with its fit.

    Attributes:
        fit: effects and parameters.
        squares: (rows, outputs) held-out squares in units of the floor.
    """

    fit: Fit
    squares: FloatArray

    @property
    def error(self) -> float:
        """Held-out mean square in units of the floor."""
        return float(np.mean(self.squares))

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The causes in the order added."""
        return self.fit.effects

    @property
    def swings(self) -> bool:
        """Whether links were simulated behind their gears."""
        return self.fit.swings

    @property
    def numbers(self) -> int:
        """How many parameters were fitted."""
        return len(self.fit.parameters)

    @property
    def complexity(self) -> float:
        """How much the model asks one to believe: names count most, then places, parameters."""
        return _complexity(self.effects, [effect.freedom for effect in self.effects])


def least_complexity(effects: Sequence[Effect]) -> float:
    """Return how much a model with these causes asks one to believe at the least, once fitted."""
    plain = Effect.freedom
    return _complexity(
        effects, [effect.freedom if type(effect).freedom is plain else 1 for effect in effects]
    )


def _complexity(effects: Sequence[Effect], freedoms: Sequence[int]) -> float:
    names = {effect.name for effect in effects}
    return 1.0 * len(names) + 0.5 * (len(effects) - len(names)) + 0.1 * sum(freedoms)
