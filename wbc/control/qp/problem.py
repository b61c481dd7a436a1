"""A quadratic program, and what a solver says about it."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from wbc.arrays import FloatArray
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
