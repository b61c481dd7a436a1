"""DAQP, a dense dual active-set solver, behind the controller's own interface."""

from __future__ import annotations

from importlib import import_module
from typing import Any, final

import numpy as np

from wbc.control.solvers.problem import QPProblem, QPSolution, QPStatus
from wbc.errors import ControlError

_EQUALITY = 5
_STATUS = {1: QPStatus.SOLVED, -1: QPStatus.INFEASIBLE, -4: QPStatus.ITERATION_LIMIT}


@final
class ActiveSetSolver:
    """Solves a sequence of programs of one size with daqp (Arnstrom, Bemporad & Axehill 2022).

    It finishes in a number of steps that grows with the constraints that bind and says at once
    when none can be met, but needs a positive definite H.
    """

    def __init__(
        self, n: int, n_eq: int, n_in: int, *, tolerance: float, max_iterations: int
    ) -> None:
        """Make room for programs of n variables, n_eq equalities and n_in inequalities.

        Raises:
            ControlError: the package daqp is not installed.
        """
        try:
            self._daqp: Any = import_module("daqp")
        except ImportError as cause:
            raise ControlError("solver 'daqp' needs the package daqp: pip install daqp.") from cause
        self._n_eq = n_eq
        self._settings = {
            "primal_tol": tolerance,
            "dual_tol": tolerance,
            "iter_limit": 10 * max_iterations,
        }
        self._rows = np.zeros((n_eq + n_in, n))
        self._upper, self._lower = np.zeros(n_eq + n_in), np.zeros(n_eq + n_in)
        self._sense = np.zeros(n_eq + n_in, dtype=np.int32)
        self._sense[:n_eq] = _EQUALITY

    def solve(self, problem: QPProblem) -> QPSolution:
        """Return the solution of `problem`, which must have the size given on construction."""
        H, g, A, b, C, lower, upper = problem
        n_eq = self._n_eq
        self._rows[:n_eq], self._rows[n_eq:] = A, C
        self._upper[:n_eq], self._upper[n_eq:] = b, upper
        self._lower[:n_eq], self._lower[n_eq:] = b, lower
        x, _, flag, info = self._daqp.solve(
            H, g, self._rows, self._upper, self._lower, self._sense, **self._settings
        )
        multipliers = np.asarray(info["lam"])
        return QPSolution(
            np.asarray(x),
            multipliers[:n_eq],
            multipliers[n_eq:],
            _STATUS.get(int(flag), QPStatus.FAILED),
            int(info["iterations"]),
        )

    def forget(self) -> None:
        """Do nothing: every solve starts from nothing."""
