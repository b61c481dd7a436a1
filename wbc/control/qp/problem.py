"""A quadratic program, and what a solver says about it."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np

from wbc.arrays import FloatArray, IntArray
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
                              + 1/2 sum over the bounds that give of (beyond)^2 / s
        s.t.  G x = t in the hard rows, lower <= C x <= upper in all other bounds

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
        give: softness s (r,) of the bounds, zero for one that must be kept.
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
    give: FloatArray

    def dense(self) -> QPProblem:
        """Return the same program with its Hessian and gradient written out, all bounds kept."""
        k, hard = self.soft, self.hard
        rows, right, softness = self.rows[:k], self.right[:k], self.softness[:k]
        A, b = self.rows[k:], self.right[k:]
        if hard.size:
            kept = softness > 0.0
            A, b = np.vstack([A, rows[hard]]), np.concatenate([b, right[hard]])
            rows, right, softness = rows[kept], right[kept], softness[kept]
        weighted = rows / softness[:, None]
        H = weighted.T @ rows
        H.reshape(-1)[:: len(H) + 1] += self.diagonal
        return QPProblem(H, -(right @ weighted) - self.pull, A, b, self.C, self.lower, self.upper)

    @property
    def hard(self) -> IntArray:
        """Which rows among the soft ones have no softness left: hard tasks."""
        return np.flatnonzero(self.softness[: self.soft] == 0.0)

    def beyond(self, x: FloatArray) -> FloatArray:
        """Return how far x (n,) is beyond each bound (r,), 0 within."""
        rows = self.C @ x
        return np.maximum(np.maximum(rows - self.upper, self.lower - rows), 0.0)

    def violation(self, x: FloatArray) -> float:
        """Return how far x (n,) is beyond the constraint that it breaks most, 0 for none."""
        hard = np.concatenate([self.hard, np.arange(self.soft, len(self.right))])
        misses = np.abs(self.rows[hard] @ x - self.right[hard])
        return max(_largest(misses), _largest(self.beyond(x)[self.give == 0.0]))

    def copied(self) -> BlockProblem:
        """Return a copy that the next tick does not overwrite."""
        arrays: Any = {k: v.copy() for k, v in self._asdict().items() if isinstance(v, np.ndarray)}
        return self._replace(**arrays)

    def cost(self, x: FloatArray) -> float:
        """Return the cost of x (n,); hard rows, and bounds that must be kept, cost nothing."""
        softness = self.softness[: self.soft]
        misses = self.rows[: self.soft] @ x - self.right[: self.soft]
        weights = np.divide(1.0, softness, out=np.zeros(self.soft), where=softness > 0.0)
        cost = (0.5 * self.diagonal * x - self.pull) @ x + 0.5 * misses @ (weights * misses)
        if self.give.any():
            gives = self.give > 0.0
            passed = self.beyond(x)[gives]
            cost += 0.5 * passed @ (passed / self.give[gives])
        return float(cost)


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
