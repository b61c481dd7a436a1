"""Any solver that qpsolvers knows, as a second opinion."""

from __future__ import annotations

from typing import final

import numpy as np
import qpsolvers

from wbc.control.solvers.problem import INFINITE, QPProblem, QPSolution, QPStatus
from wbc.errors import ControlError, unknown_name


@final
class ForeignSolver:
    """Solves one program after the other with a qpsolvers backend, each from nothing.

    Two-sided rows become two one-sided ones where both bounds are finite; the multipliers are
    folded back.
    """

    def __init__(self, backend: str) -> None:
        """Choose a backend by the name that qpsolvers gives it.

        Raises:
            ControlError: the backend is not installed; the message lists those that are.
        """
        if backend not in qpsolvers.available_solvers:
            raise ControlError(unknown_name("QP solver", backend, qpsolvers.available_solvers))
        self._backend = backend

    def solve(self, problem: QPProblem) -> QPSolution:
        """Return the solution of `problem`; a solver that finds none is INFEASIBLE."""
        high = problem.upper < INFINITE
        low = problem.lower > -INFINITE
        G = np.concatenate([problem.C[high], -problem.C[low]])
        h = np.concatenate([problem.upper[high], -problem.lower[low]])
        quadratic = qpsolvers.Problem(problem.H, problem.g, G, h, problem.A, problem.b)
        try:
            found = qpsolvers.solve_problem(quadratic, solver=self._backend)
        except (qpsolvers.SolverError, ValueError):
            return _nothing(problem, QPStatus.FAILED)
        if not found.found or found.x is None:
            return _nothing(problem, QPStatus.INFEASIBLE)
        z = np.zeros(len(problem.lower))
        multipliers = np.zeros(len(h)) if found.z is None else found.z
        z[high] += multipliers[: int(high.sum())]
        z[low] -= multipliers[int(high.sum()) :]
        y = np.zeros(len(problem.b)) if found.y is None else np.asarray(found.y)
        return QPSolution(np.asarray(found.x), y, z, QPStatus.SOLVED, 0)

    def forget(self) -> None:
        """Do nothing: every solve starts from nothing."""


def _nothing(problem: QPProblem, status: QPStatus) -> QPSolution:
    n = len(problem.g)
    return QPSolution(
        np.full(n, np.nan), np.zeros(len(problem.b)), np.zeros(len(problem.lower)), status, 0
    )
