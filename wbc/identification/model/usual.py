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
        noise: (outputs,) mean square of what is left over independent samples per row: squares of
            the logs are divided by it, so that both are in squared standard deviations.
        samples: (outputs,) independent samples per row.
    """

    residual: FloatArray
    jacobian: FloatArray
    noise: FloatArray
    samples: FloatArray

    @classmethod
    def none(cls, outputs: int, count: int) -> UsualRows:
        """Return no rows about so many parameters."""
        return cls(np.zeros(0), np.zeros((0, count)), np.ones(outputs), np.ones(outputs))

    @classmethod
    def of(
        cls,
        effects: Sequence[Effect],
        slots: Sequence[tuple[int, Parameter]],
        noise: FloatArray,
        samples: FloatArray,
    ) -> UsualRows:
        """Return the rows of these effects.

        Args:
            effects: with their numbers.
            slots: the p parameters as (number of effect, parameter).
            noise: (outputs,) mean square of what is left over independent samples per row.
            samples: (outputs,) independent samples per row.
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
        return cls(residual, jacobian, noise, samples)

    @property
    def weights(self) -> FloatArray:
        """(outputs,) by which residuals are multiplied in a fit."""
        return np.asarray(1.0 / np.sqrt(self.noise))

    def cost(self, residual: FloatArray) -> float:
        """Return what is minimised, with a residual (rows, outputs) of the logs [2 nats].

        Minus twice the log density, each output with a variance of its own, never below that of
        its sensors: an output that nothing explains does not outvote the others.
        """
        squares = np.mean(residual**2, axis=0)
        variance = np.maximum(squares, 1.0)
        each = np.log(variance) + squares / variance
        return float(len(residual) * self.samples @ each + self.residual @ self.residual)


def _slope(effect: Effect, parameter: Parameter, before: FloatArray) -> FloatArray:
    value = effect.values[parameter.name]
    step = STEP * parameter.scale * (-1.0 if value + parameter.scale > parameter.high else 1.0)
    after = effect.with_values({parameter.name: value + step}).departures
    return np.asarray((after - before) * (parameter.scale / step))
