"""One step downhill: Gauss-Newton within the ranges, straight on in the links' pseudo-inertias."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.effects import pseudo_inertia
from wbc.identification.model.residual import Slots, with_changes
from wbc.identification.model.usual import Drawings, UsualRows, links_among
from wbc.robot import Effect

# Added to a diagonal of ones, so that parameters that repeat one another can be solved for.
RIDGE = 1e-9
IDLE = 1e-7
"""Of the longest column: a shorter one is rounding."""
_ROUNDS = 12  # Newton's steps on what drawings cost: three or four do
_SHORTER = 0.4, 8  # by how much a step is cut that makes more of it, and how often
_LAST = 0.1  # share of what matters that the last of them gains


class Descent(NamedTuple):
    """A step, and what derivatives promise of it.

    Attributes:
        along: (p,) in scales of the parameters, along the derivatives.
        effects: at its end.
        promised: by how much the cost falls.
    """

    along: FloatArray
    effects: list[Effect]
    promised: float


@dataclass(frozen=True, eq=False)
class Linearised:
    """What a fit leaves where derivatives hold, and what is usual beside it.

    With r what is left, J its derivatives and e a step, the cost is

        |W (r + J e)|^2 + |what is beyond usual ranges|^2 + what the drawings cost at Q + e T

    convex in e, which Newton's steps make least. In log-Cholesky numbers it is not: steps of Gauss
    and Newton took derivatives 6.2 times in a fit to a recorded KUKA LWR4, these take them 3.2
    times (25 fits of up to 31 causes).

    Attributes:
        effects: where.
        slots: the p parameters as (number of effect, parameter).
        gram, moment: (p, p), (p,) normal equations of all but the drawings.
        drawings: of the n links that are drawn.
        links: (n, 10) which of the parameters are theirs.
    """

    effects: Sequence[Effect]
    slots: Slots
    gram: FloatArray
    moment: FloatArray
    drawings: Drawings
    links: IntArray

    @classmethod
    def of(
        cls,
        effects: Sequence[Effect],
        slots: Slots,
        residual: FloatArray,
        jacobian: FloatArray,
        usual: UsualRows,
    ) -> Linearised:
        """Return that of a residual (rows, outputs) and its derivatives (rows, outputs, p)."""
        a, beside = usual.weighted(jacobian), usual.jacobian[usual.drawn :]
        gram = a.T @ a + beside.T @ beside
        moment = a.T @ (residual * usual.weights).ravel()
        moment += beside.T @ usual.residual[usual.drawn :]
        links = links_among(effects, slots)
        return cls(effects, slots, gram, moment, Drawings.of(effects), links)

    def step(self, damping: float, least: float, share: float = 1.0) -> Descent:
        """Return the step to where the cost is least, near here.

        Args:
            damping: of Levenberg and Marquardt, beside ones on the diagonal.
            least: gain that matters.
            share: of the way that is gone.
        """
        own, drawn, scales = self.drawings, self.links.ravel(), self.scales
        room = ranges(self.effects, self.slots)
        room[:, drawn] = [[-np.inf], [np.inf]]  # any step of Q is a body, or is cut
        near, matrices, value = np.zeros(len(scales)), own.matrices, own.cost(own.matrices)
        before = value
        known, along = self._normal(near, matrices)
        trust = damping * np.diagonal(known)
        for _ in range(_ROUNDS):
            whole, _ = bounded(known + np.diag(trust), along + trust * near, room - near)
            for part in _SHORTER[0] ** np.arange(_SHORTER[1]):
                there = near + part * whole
                moved = own.along((there * scales)[self.links])
                new = own.cost(moved) + self._quadratic(there) + float(trust @ there**2)
                if new < value:
                    break
            else:
                break
            gain, value, near, matrices = value - new, new, there, moved
            if gain < _LAST * least or not drawn.size:
                break
            known, along = self._normal(near, matrices)
        near = share * near
        matrices = own.along((near * scales)[self.links])
        changes = near * scales
        changes[drawn] = (pseudo_inertia.numbers_of(matrices) - own.numbers).ravel()
        names = [(k, parameter.name) for k, parameter in self.slots]
        ends = dict(zip(names, changes.tolist(), strict=True))
        promised = before - own.cost(matrices) - self._quadratic(near)
        return Descent(near, with_changes(self.effects, ends, clip=True), promised)

    @cached_property
    def scales(self) -> FloatArray:
        """(p,) of the parameters."""
        return np.array([parameter.scale for _, parameter in self.slots])

    def _normal(self, step: FloatArray, matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Newton's matrix (p, p) and slope (p,) of half the cost a step (p,) further."""
        slopes, curved = self.drawings.bend(matrices)
        known, along = self.gram.copy(), self.moment + self.gram @ step
        for rows, slope, curve in zip(self.links, slopes, curved, strict=True):
            scales = self.scales[rows]
            along[rows] += slope * scales
            known[np.ix_(rows, rows)] += curve * np.outer(scales, scales)
        return known, along

    def _quadratic(self, step: FloatArray) -> float:
        return float(step @ (2.0 * self.moment + self.gram @ step))


def ranges(effects: Sequence[Effect], slots: Slots) -> FloatArray:
    """Return (2, p) how far each parameter is from the ends of its range, in scales."""
    each = [(p.low, p.high, effects[k].values[p.name], p.scale) for k, p in slots]
    low, high, values, scales = np.reshape(each, (-1, 4)).T
    return np.asarray(np.array([low - values, high - values]) / scales)


def bounded(
    known: FloatArray, moment: FloatArray, room: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return the step (p,) that solves `known` step = -moment, and which parameters are free (p,).

    Those that would leave their range, room (2, p) around them, go to its end.
    """
    free, step = np.ones(len(moment), dtype=bool), np.zeros(len(moment))
    for _ in range(len(moment) + 1):
        if free.any():
            beside = moment[free] + known[np.ix_(free, ~free)] @ step[~free]
            step[free] = -_solved(known[np.ix_(free, free)], beside)
        beyond = free & ((step < room[0]) | (step > room[1]))
        if not beyond.any():
            break
        step = np.where(beyond, np.clip(step, *room), step)
        free &= ~beyond
    return step, free


def _solved(gram: FloatArray, moment: FloatArray) -> FloatArray:
    """Return the solution (p,) of normal equations, weak directions and idle columns left alone."""
    norm = np.sqrt(np.diagonal(gram))
    size = np.where(norm > IDLE * norm.max(initial=0.0), norm, np.inf)
    known = gram / np.outer(size, size) + RIDGE * np.eye(size.size)
    return np.asarray(np.linalg.solve(known, moment / size) / size)
