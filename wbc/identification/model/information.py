"""What is known of the numbers of effects: what is usual before, and what the logs tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.columns import STEP
from wbc.identification.records.folds import rows_of_folds
from wbc.robot import Effect, Parameter

# Added to a diagonal of ones, so that parameters that repeat one another can be solved for.
_RIDGE = 1e-9


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
            parts.append(_departures(effect))
            ends.append(ends[-1] + parts[-1].size)
        residual = np.concatenate([np.zeros(0), *parts])
        jacobian = np.zeros((residual.size, len(slots)))
        if residual.size:
            for column, (k, parameter) in enumerate(slots):
                if parts[k].size:
                    rows = slice(ends[k], ends[k + 1])
                    jacobian[rows, column] = slope_of(_departures, effects[k], parameter, parts[k])
        return cls(residual, jacobian, noise, samples)

    @property
    def weights(self) -> FloatArray:
        """(outputs,) by which residuals are multiplied in a fit."""
        return np.asarray(1.0 / np.sqrt(self.noise))

    def weighted(self, jacobian: FloatArray) -> FloatArray:
        """Return derivatives (rows, outputs, p) with these weights, (rows * outputs, p)."""
        rows, outputs, count = jacobian.shape
        plain = jacobian.reshape(rows * outputs, count)
        if np.all(self.noise == 1.0):  # always, where nothing is drawn
            return plain
        return np.asarray((jacobian * self.weights[:, None]).reshape(plain.shape))

    def cost(self, residual: FloatArray) -> float:
        """Return what is minimised, with a residual (rows, outputs) of the logs [2 nats].

        Minus twice the log density, each output with a variance of its own, never below that of
        its sensors: an output that nothing explains does not outvote the others.
        """
        squares = np.mean(residual**2, axis=0)
        variance = np.maximum(squares, 1.0)
        each = np.log(variance) + squares / variance
        return float(len(residual) * self.samples @ each + self.residual @ self.residual)

    def beside_open(
        self, held: FloatArray, jacobian: FloatArray, folds: IntArray
    ) -> tuple[FloatArray, float]:
        """Return held-out squares (rows, outputs) beside what is open, and what that costs [nats].

        A fold that is left out may be the only one that tells some of the drawn numbers. What the
        others then predict is off by as much as the prior leaves open, which a prediction with one
        value for each number takes for a miss. So the drawn numbers are integrated over. Numbers
        without a prior keep their one value: they have to repeat themselves from fold to fold.

        With r the held-out residual of a fold, W its weights, J its derivatives by the drawn
        numbers and A what all folds and the prior know of them, the log density of r is

            -1/2 r' (W - W J A^-1 J' W) r  +  1/2 log det(A - J' W J)  -  1/2 log det A  + const

        (Woodbury). Where nothing is drawn, these are the held-out squares, and no cost.

        Args:
            held: (rows, outputs) residual of each row, predicted without its fold.
            jacobian: (rows, outputs, p) per unit of each parameter's scale.
            folds: (rows,) number of the fold of every row.
        """
        drawn = np.any(self.jacobian, axis=0)
        if not drawn.any():
            return held**2, 0.0
        a = jacobian[:, :, drawn] * self.weights[:, None]
        count = int(drawn.sum())
        usual = self.jacobian[:, drawn]
        known = a.reshape(-1, count).T @ a.reshape(-1, count) + usual.T @ usual
        squares, cost = np.empty_like(held), 0.0
        for inside in rows_of_folds(folds):
            own = a[inside].reshape(-1, count)
            moment = own.T @ (held[inside] * self.weights).ravel()
            still_open = a[inside] @ np.linalg.solve(known, moment) / self.weights
            squares[inside] = held[inside] * (held[inside] - still_open)
            cost += 0.5 * (_log_det(known) - _log_det(known - own.T @ own))
        return squares, cost


def _log_det(matrix: FloatArray) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def _departures(effect: Effect) -> FloatArray:
    """Return how far an effect is from what is usual, and each of its numbers that has a range.

    Beside open drawings no log tells a torque constant: it scales with all masses.
    """
    values = effect.values
    own = [p.usual.departure(values[p.name]) for p in effect.parameters if p.usual is not None]
    return np.concatenate([effect.search.departures(effect), own])


def slope_of(
    told: Callable[[Effect], FloatArray], effect: Effect, parameter: Parameter, now: FloatArray
) -> FloatArray:
    """Return by how much the numbers (n,) that an effect tells, `now`, change per scale."""
    value = effect.values[parameter.name]
    step = STEP * parameter.scale * (-1.0 if value + parameter.scale > parameter.high else 1.0)
    after = told(effect.with_values({parameter.name: value + step}))
    return np.asarray((after - now) * (parameter.scale / step))


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
