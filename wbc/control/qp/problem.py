"""A quadratic program, and what a solver says about it."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Count, Dense, Flag, Number, Row, Vector, compiled
from wbc.errors import ControlError
from wbc.files import atomic_write

INFINITE = 1e20
"""What counts as no bound."""


class QPProblem(NamedTuple):
    """min 1/2 x'Hx + g'x  subject to  A x = b,  lower <= C x <= upper.

    Attributes:
        H: (n, n), positive semi-definite.
        g: (n,).
        A: (n_eq, n).
        b: (n_eq,).
        C: (n_in, n).
        lower: (n_in,); -INFINITE or less is no bound.
        upper: (n_in,); INFINITE or more is no bound.
    """

    H: FloatArray
    g: FloatArray
    A: FloatArray
    b: FloatArray
    C: FloatArray
    lower: FloatArray
    upper: FloatArray

    def copied(self) -> QPProblem:
        """Return a copy that the next tick does not overwrite."""
        return QPProblem(*(array.copy() for array in self))

    def save(self, path: str | Path) -> Path:
        """Write the program to a compressed `.npz` file, whole or not at all; return its path."""
        return atomic_write(path, lambda file: np.savez_compressed(file, **self._asdict()))

    @classmethod
    def load(cls, path: str | Path) -> QPProblem:
        """Read a program that `save` wrote.

        Raises:
            ControlError: no such file, or not one of these.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls(*(np.asarray(archive[name], dtype=np.float64) for name in cls._fields))
        except (OSError, ValueError, KeyError, BadZipFile) as cause:
            raise ControlError(f"'{path}' holds no saved program: {cause}.") from cause


class BlockProblem(NamedTuple):
    """A program that keeps its structure: a diagonal, and rows that are soft or hard.

        min   1/2 x'D x - p'x + 1/2 sum over the soft rows of (G x - t)^2 / s
        s.t.  G x = t in the hard rows, lower <= C x <= upper

    Attributes:
        diagonal: D (n,).
        pull: p (n,).
        rows: G (k, n), soft rows first.
        right: t (k,).
        softness: s (k,), the inverse of a soft row's weight, zero for a hard row. A task of
            infinite weight stands among the soft rows with a softness of zero.
        soft: how many rows are soft.
        C: (r, n).
        lower: (r,); -INFINITE or less is no bound.
        upper: (r,); INFINITE or more is no bound.
        hardens: whether a soft row may have a softness of zero.
    """

    diagonal: FloatArray
    pull: FloatArray
    rows: FloatArray
    right: FloatArray
    softness: FloatArray
    soft: int
    C: FloatArray
    lower: FloatArray
    upper: FloatArray
    hardens: bool = False

    def dense(self) -> QPProblem:
        """Return the same program with its Hessian and gradient written out."""
        k = self.soft
        hard = self.hard
        rows, right, softness = self.rows[:k], self.right[:k], self.softness[:k]
        if len(hard):
            kept = softness > 0.0
            rows, right, softness = rows[kept], right[kept], softness[kept]
        weighted = rows / softness[:, None]
        H = weighted.T @ rows
        H.reshape(-1)[:: len(H) + 1] += self.diagonal
        g = -(right @ weighted) - self.pull
        A = np.vstack([self.rows[k:], self.rows[hard]])
        b = np.concatenate([self.right[k:], self.right[hard]])
        return QPProblem(H, g, A, b, self.C, self.lower, self.upper)

    @property
    def hard(self) -> IntArray:
        """Which rows among the soft ones have no softness left: hard tasks."""
        return np.flatnonzero(self.softness[: self.soft if self.hardens else 0] == 0.0)

    def nearest_to(self, x: FloatArray) -> BlockProblem:
        """Return the program of the point that keeps the constraints and is nearest to x (n,).

        Distances count by the diagonal; the soft rows are left out.
        """
        k, hard = self.soft, self.hard
        rows, right, softness = self.rows[k:], self.right[k:], self.softness[k:]
        if len(hard):
            rows = np.vstack([self.rows[hard], rows])
            right = np.concatenate([self.right[hard], right])
            softness = np.concatenate([self.softness[hard], softness])
        pull = self.diagonal * x
        return self._replace(
            pull=pull, rows=rows, right=right, softness=softness, soft=0, hardens=False
        )

    def violation(self, x: FloatArray) -> float:
        """Return how far x (n,) is beyond the constraint that it breaks most, 0 for none."""
        _, _, rows, right, softness, soft, C, lower, upper, hardens = self
        first = 0 if hardens else soft
        return worst_miss(rows, right, softness, first, soft, C, lower, upper, x)

    def copied(self) -> BlockProblem:
        """Return a copy that the next tick does not overwrite."""
        D, p, rows, right, softness, soft, C, lower, upper, hardens = self
        own = D.copy(), p.copy(), rows.copy(), right.copy(), softness.copy()
        return BlockProblem(*own, soft, C.copy(), lower.copy(), upper.copy(), hardens)

    def cost(self, x: FloatArray) -> float:
        """Return the cost of x (n,)."""
        soft = self.rows, self.right, self.softness, self.soft
        return cost_at(self.diagonal, self.pull, *soft, x)


@compiled(Flag, Vector)
def is_finite(values: FloatArray) -> bool:
    """Return whether all values (k,) are finite."""
    found = True
    for i in range(len(values)):
        found = found and np.isfinite(values[i])
    return found


@compiled(Number, *(Row, Row, Dense, Row, Row, Count, Row))
def cost_at(
    diagonal: FloatArray,
    pull: FloatArray,
    rows: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    soft: int,
    x: FloatArray,
) -> float:
    """Return the cost of x (n,), arguments as in `BlockProblem`; hard rows cost nothing."""
    cost = 0.0
    for j in range(len(x)):
        cost += (0.5 * diagonal[j] * x[j] - pull[j]) * x[j]
    for i in range(soft):
        if softness[i] > 0.0:
            miss = -right[i]
            for j in range(len(x)):
                miss += rows[i, j] * x[j]
            cost += 0.5 * miss * miss / softness[i]
    return cost


@compiled(Number, *(Dense, Row, Row, Count, Count, Dense, Row, Row, Row))
def worst_miss(
    rows: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    first: int,
    soft: int,
    C: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    x: FloatArray,
) -> float:
    """Return how far x (n,) is beyond the constraint that it breaks most, 0 for none.

    Args:
        rows, right, softness, soft, C, lower, upper: as in `BlockProblem`.
        first: row from which those without softness are constraints.
        x: (n,).
    """
    worst = 0.0
    for i in range(first, len(right)):
        if i >= soft or softness[i] == 0.0:
            miss = -right[i]
            for j in range(len(x)):
                miss += rows[i, j] * x[j]
            worst = max(worst, abs(miss))
    for i in range(len(lower)):
        value = 0.0
        for j in range(len(x)):
            value += C[i, j] * x[j]
        worst = max(worst, value - upper[i], lower[i] - value)
    return worst


class QPStatus(Enum):
    """How solving ended."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    ITERATION_LIMIT = "iteration limit"
    FAILED = "failed"


class QPSolution(NamedTuple):
    """What a solver returned.

    Attributes:
        x: (n,).
        y: multipliers (n_eq,) of the equalities.
        z: multipliers (n_in,), positive at an upper bound, negative at a lower one.
        status: how it ended.
        iterations: of the solver.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    status: QPStatus
    iterations: int

    def primal_residual(self, problem: QPProblem) -> float:
        """Return the largest violation of a constraint."""
        rows = problem.C @ self.x
        return max(
            _largest(np.abs(problem.A @ self.x - problem.b)),
            _largest(rows - problem.upper),
            _largest(problem.lower - rows),
        )

    def dual_residual(self, problem: QPProblem) -> float:
        """Return the largest entry of |Hx + g + A'y + C'z|."""
        gradient = problem.H @ self.x + problem.g + problem.A.T @ self.y + problem.C.T @ self.z
        return _largest(np.abs(gradient))

    def duality_gap(self, problem: QPProblem) -> float:
        """Return |x'Hx + g'x + b'y + upper'z+ + lower'z-|, zero at an optimum."""
        high, low = np.maximum(self.z, 0.0), np.minimum(self.z, 0.0)
        bounded_high = np.where(problem.upper < INFINITE, problem.upper, 0.0)
        bounded_low = np.where(problem.lower > -INFINITE, problem.lower, 0.0)
        gap = (
            self.x @ problem.H @ self.x
            + problem.g @ self.x
            + problem.b @ self.y
            + bounded_high @ high
            + bounded_low @ low
        )
        return abs(float(gap))


def _largest(values: FloatArray) -> float:
    return max(0.0, float(values.max())) if values.size else 0.0
