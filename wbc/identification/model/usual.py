"""What is usual before the logs speak: links as they are drawn, numbers in their ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.effects import pseudo_inertia
from wbc.identification.model.columns import change_along
from wbc.identification.model.residual import Slots
from wbc.robot import Effect
from wbc.robot.effect import usual_cost

_COUNT = len(pseudo_inertia.LOG_CHOLESKY)


@dataclass(frozen=True, eq=False)
class Drawings:
    """The n links of some effects that are held to a drawing.

    What they need is linear in their pseudo-inertias, and so is no fit in their log-Cholesky
    numbers: a step moves the pseudo-inertias Q straight on, along the derivatives T of Q.

    Attributes:
        numbers: (n, 10) log-Cholesky numbers.
        effects: (n,) number of the effect of each, among those with links: one factor says how
            wrong all links of an effect are drawn.
    """

    numbers: FloatArray
    effects: IntArray

    @classmethod
    def of(cls, effects: Sequence[Effect]) -> Drawings:
        """Return the links of these effects, in order."""
        own = [[*effect.values.values()] for effect in effects if effect.search.drawn]
        owners = [k for k, numbers in enumerate(own) for _ in numbers[::_COUNT]]
        numbers = np.array([number for numbers in own for number in numbers])
        return cls(numbers.reshape(-1, _COUNT), np.array(owners, dtype=np.intp))

    @cached_property
    def matrices(self) -> FloatArray:
        """(n, 4, 4) Q."""
        return pseudo_inertia.matrix_of(self.numbers)

    @cached_property
    def tangents(self) -> FloatArray:
        """(n, 10, 4, 4) T."""
        return pseudo_inertia.tangents(self.numbers)

    def along(self, step: FloatArray) -> FloatArray:
        """Return Q (n, 4, 4) a step (n, 10) further."""
        return np.asarray(self.matrices + np.einsum("nk,nkij->nij", step, self.tangents))

    def more_wrong(self, squares: FloatArray) -> FloatArray:
        """Return (n,) by which factors the drawings are more wrong than usual, see there.

        Args:
            squares: (n,) from what is usual.
        """
        sums = np.asarray(np.bincount(self.effects, squares), dtype=float)
        counts = _COUNT * np.bincount(self.effects)
        return np.asarray(pseudo_inertia.more_wrong(sums, counts)[self.effects])

    def cost(self, matrices: FloatArray) -> float:
        """Return what links with Q (n, 4, 4) cost [2 nats], infinite where one is no body."""
        squares = pseudo_inertia.divergence(matrices) / pseudo_inertia.USUAL**2
        if not np.isfinite(squares).all():
            return np.inf
        size = self.more_wrong(squares)
        _, first = np.unique(self.effects, return_index=True)
        wider = np.sum(np.log1p((np.log(size[first]) / pseudo_inertia.SPREAD) ** 2))
        return float(np.sum(squares / size**2 + 2.0 * _COUNT * np.log(size)) + 2.0 * wider)

    def bend(self, matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the slopes (n, 10) and curvatures (n, 10, 10) of half the cost along T.

        Of tr(Q) - log det Q they are tr(T_k) - tr(Q^-1 T_k) and tr(Q^-1 T_k Q^-1 T_l).
        """
        size = self.more_wrong(pseudo_inertia.divergence(matrices) / pseudo_inertia.USUAL**2)
        weights = 0.5 / (pseudo_inertia.USUAL * size) ** 2
        each = np.linalg.inv(matrices)[:, None] @ self.tangents
        traces = (np.trace(own, axis1=2, axis2=3) for own in (self.tangents, each))
        slopes = np.subtract(*traces)
        curved = np.einsum("nkij,nlji->nkl", each, each)
        return slopes * weights[:, None], curved * weights[:, None, None]


class Part(NamedTuple):
    """Normal equations of some rows of a fit.

    Attributes:
        rows: their numbers.
        gram: (p, p), beside numbers that are drawn in squared standard deviations.
        moment: (p,) likewise.
    """

    rows: IntArray | slice
    gram: FloatArray
    moment: FloatArray


@dataclass(frozen=True, eq=False)
class UsualRows:
    """Departures of effects from what is usual, and their derivatives.

    Attributes:
        residual: (k,).
        jacobian: (k, p) per unit of each parameter's scale.
        noise: (outputs,) mean square of what is left over independent samples per row: squares of
            the logs are divided by it, so that both are in squared standard deviations.
        drawn: how many of the rows, the first ones, are those of drawings.
    """

    residual: FloatArray
    jacobian: FloatArray
    noise: FloatArray
    drawn: int = 0

    @classmethod
    def of(
        cls, effects: Sequence[Effect], slots: Slots, left: FloatArray, samples: FloatArray
    ) -> UsualRows:
        """Return the rows of these effects; none where nothing is drawn.

        Beside open drawings no log tells a torque constant: it scales with all masses. Numbers are
        held to a drawing with the standard deviation that is likeliest, see `more_wrong`. With the
        usual one a tool of 2.8 kg on a flange of 0.2 kg cost 12,700 nats.

        Args:
            effects: with their numbers.
            slots: the p parameters as (number of effect, parameter).
            left: (rows, outputs) what is left.
            samples: (outputs,) independent samples per row.
        """
        drawings, count = Drawings.of(effects), len(slots)
        if not drawings.numbers.size:
            return cls(np.zeros(0), np.zeros((0, count)), np.ones(left.shape[1]))
        departures = pseudo_inertia.departures(drawings.numbers)
        size = drawings.more_wrong(np.sum(departures**2, axis=1))[:, None]
        slopes = pseudo_inertia.slopes(drawings.numbers) / size[..., None]
        jacobian = np.zeros((departures.size, count))
        for n, rows in enumerate(links_among(effects, slots)):
            jacobian[n * _COUNT : (n + 1) * _COUNT, rows] = slopes[n]
        beyond, along = [], []
        for row, (k, parameter) in enumerate(slots):
            if (usual := parameter.usual) is not None:
                value = effects[k].values[parameter.name]
                beyond.append(usual.departure(value))
                along.append(usual.slope(value) * np.eye(1, count, row))
        residual = np.concatenate([(departures / size).ravel(), beyond])
        jacobian = np.concatenate([jacobian, *along]) * [p.scale for _, p in slots]
        variance = np.maximum(np.mean(left**2, axis=0), 1.0)
        return cls(residual, jacobian, variance / samples, departures.size)

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

    def beside_open(
        self, held: FloatArray, jacobian: FloatArray, parts: Sequence[Part]
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
            parts: of the fit, fold by fold.
        """
        drawn = np.any(self.jacobian, axis=0)
        if not drawn.any():
            return held**2, 0.0
        chosen, usual = np.ix_(drawn, drawn), self.jacobian[:, drawn]
        known = np.sum([part.gram[chosen] for part in parts], axis=0) + usual.T @ usual
        squares, cost = np.empty_like(held), 0.0
        for rows, gram, _ in parts:
            own, left = jacobian[rows], held[rows]
            moment = np.einsum("rop,ro->p", own, left / self.noise)
            step = np.zeros(drawn.size)
            step[drawn] = np.linalg.solve(known, moment[drawn])
            squares[rows] = left * (left - change_along(own, step))
            cost += 0.5 * (_log_det(known) - _log_det(known - gram[chosen]))
        return squares, cost


def cost(effects: Sequence[Effect], left: FloatArray, samples: FloatArray) -> float:
    """Return what a fit makes least.

    Where nothing is drawn, the sum of squares of what is left (rows, outputs). Else minus twice the
    log density [2 nats], each output with a variance of its own, never below that of its sensors:
    an output that nothing explains does not outvote the others.
    """
    drawings = Drawings.of(effects)
    if not drawings.numbers.size:
        return float(np.sum(left**2))
    squares = np.mean(left**2, axis=0)
    variance = np.maximum(squares, 1.0)
    each = np.log(variance) + squares / variance
    ranges = 2.0 * sum(usual_cost(effect) for effect in effects)
    return float(len(left) * samples @ each + drawings.cost(drawings.matrices) + ranges)


def links_among(effects: Sequence[Effect], slots: Slots) -> IntArray:
    """Return (n, 10) which of the parameters are those of each drawn link."""
    rows = [row for row, (k, _) in enumerate(slots) if effects[k].search.drawn]
    return np.reshape(np.array(rows, dtype=np.intp), (-1, _COUNT))


def _log_det(matrix: FloatArray) -> float:
    return float(np.linalg.slogdet(matrix)[1])
