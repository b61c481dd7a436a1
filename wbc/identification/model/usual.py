"""What is usual before any log speaks, as rows of a fit beside those of the logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.model.kept_columns import STEP
from wbc.robot import Effect, Parameter


@dataclass(frozen=True, eq=False)
class UsualRows:
    """Departures of effects from what is usual, and their derivatives.

    Attributes:
        residual: (k,).
        jacobian: (k, p) per unit of each parameter's scale.
        weight: of a squared standard deviation beside the squares of the logs.
    """

    residual: FloatArray
    jacobian: FloatArray
    weight: float

    @classmethod
    def none(cls, count: int) -> UsualRows:
        """Return no rows about so many parameters."""
        return cls(np.zeros(0), np.zeros((0, count)), 1.0)

    @classmethod
    def of(
        cls, effects: Sequence[Effect], slots: Sequence[tuple[int, Parameter]], noise: float
    ) -> UsualRows:
        """Return the rows of these effects.

        Args:
            effects: with their numbers.
            slots: the p parameters as (number of effect, parameter).
            noise: mean square of the residual over independent samples per row: what a squared
                standard deviation weighs beside the sum of squares of all rows.
        """
        parts, ends = [], [0]
        for effect in effects:
            parts.append(effect.departures)
            ends.append(ends[-1] + parts[-1].size)
        residual = np.concatenate([np.zeros(0), *parts])
        jacobian = np.zeros((residual.size, len(slots)))
        if residual.size:
            for column, (k, parameter) in enumerate(slots):
                if parts[k].size:
                    rows = slice(ends[k], ends[k + 1])
                    jacobian[rows, column] = _slope(effects[k], parameter, parts[k])
        weight = np.sqrt(noise)
        return cls(weight * residual, weight * jacobian, noise)

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


def _slope(effect: Effect, parameter: Parameter, before: FloatArray) -> FloatArray:
    value = effect.values[parameter.name]
    step = STEP * parameter.scale * (-1.0 if value + parameter.scale > parameter.high else 1.0)
    after = effect.with_values({parameter.name: value + step}).departures
    return np.asarray((after - before) * (parameter.scale / step))
