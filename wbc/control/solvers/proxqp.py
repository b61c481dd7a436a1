"""ProxQP behind the controller's own interface: one native object, updated every tick."""

from __future__ import annotations

from math import isqrt
from typing import final

import numpy as np
from proxsuite import proxqp

from wbc.control.solvers.problem import QPProblem, QPSolution, QPStatus

_STATUS = {
    proxqp.PROXQP_SOLVED: QPStatus.SOLVED,
    proxqp.PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE: QPStatus.SOLVED,
    proxqp.PROXQP_PRIMAL_INFEASIBLE: QPStatus.INFEASIBLE,
    proxqp.PROXQP_DUAL_INFEASIBLE: QPStatus.FAILED,
    proxqp.PROXQP_MAX_ITER_REACHED: QPStatus.ITERATION_LIMIT,
    proxqp.PROXQP_NOT_RUN: QPStatus.FAILED,
}


@final
class ProxQPSolver:
    """Solves a sequence of programs of one size with proxsuite's dense ProxQP.

    Each solve starts from the previous solution with the penalties reset
    (COLD_START_WITH_PREVIOUS_RESULT): the fully warm start calls feasible programs infeasible or
    stalls on them. The duality gap is part of the stopping rule: without it a start that is
    feasible and stationary, but pushes against a bound that has moved away, is returned as the
    solution after no iteration at all. From far off it still calls programs infeasible that leave
    hardly any room, so that a failure is believed only of a start from nothing. Iterations are
    bounded inside and outside; together they are at most `max_iterations` per start. The caller
    makes sure that every number is finite and lower <= upper; ProxQP would not return otherwise.
    """

    def __init__(
        self, n: int, n_eq: int, n_in: int, *, tolerance: float, max_iterations: int
    ) -> None:
        """Make room for programs of n variables, n_eq equalities and n_in inequalities."""
        self._qp = proxqp.dense.QP(
            n, n_eq, n_in, dense_backend=proxqp.dense.DenseBackend.PrimalDualLDLT
        )
        settings = self._qp.settings
        settings.initial_guess = proxqp.InitialGuess.COLD_START_WITH_PREVIOUS_RESULT
        settings.eps_abs = tolerance
        settings.eps_rel = 0.0
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = 10.0 * tolerance
        settings.eps_duality_gap_rel = tolerance
        settings.eps_primal_inf = 1e-14
        settings.max_iter = max(isqrt(2 * max_iterations), 1)
        settings.max_iter_in = max(max_iterations // settings.max_iter, 1)
        self._started = False

    def solve(self, problem: QPProblem) -> QPSolution:
        """Return the solution of `problem`, which must have the size given on construction."""
        warm = self._started
        solution = self._solve(problem)
        if warm and solution.status is not QPStatus.SOLVED:
            self.forget()
            solution = self._solve(problem)
        return solution

    def _solve(self, problem: QPProblem) -> QPSolution:
        H, g, A, b, C, lower, upper = problem
        if self._started:
            self._qp.update(H=H, g=g, A=A, b=b, C=C, l=lower, u=upper)
        else:
            self._qp.init(H, g, A, b, C, lower, upper)
            self._started = True
        self._qp.solve()
        results = self._qp.results
        info = results.info
        return QPSolution(
            np.array(results.x),
            np.array(results.y),
            np.array(results.z),
            _STATUS[info.status],
            int(info.iter),
        )

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._qp.cleanup()
        self._started = False
