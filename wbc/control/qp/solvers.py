"""The solvers behind the controller's own guess: ProxQP, DAQP, and whatever qpsolvers knows."""

from __future__ import annotations

from enum import Enum
from math import isqrt
from typing import Protocol, final

import daqp
import numpy as np
import qpsolvers
from proxsuite import proxqp

from wbc.control.qp.problem import INFINITE, QPProblem, QPSolution, QPStatus
from wbc.errors import ControlError, unknown_name

_PROXQP = {
    proxqp.PROXQP_SOLVED: QPStatus.SOLVED,
    proxqp.PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE: QPStatus.SOLVED,
    proxqp.PROXQP_PRIMAL_INFEASIBLE: QPStatus.INFEASIBLE,
    proxqp.PROXQP_DUAL_INFEASIBLE: QPStatus.FAILED,
    proxqp.PROXQP_MAX_ITER_REACHED: QPStatus.ITERATION_LIMIT,
    proxqp.PROXQP_NOT_RUN: QPStatus.FAILED,
}
_EQUALITY = 5
_DAQP = {1: QPStatus.SOLVED, -1: QPStatus.INFEASIBLE, -4: QPStatus.ITERATION_LIMIT}


_NATIVE = "proxqp", "daqp"


class WarmStart(Enum):
    """What a tick takes over from the last one.

    ACTIVE_SET tries the constraints that bound the last solution, in one small linear system whose
    solution is taken if it fulfils every condition of optimality; the solver is asked otherwise.
    SOLVER always asks the solver, which starts from its own last solution where it can.
    """

    ACTIVE_SET = "active_set"
    SOLVER = "solver"


class Solver(Protocol):
    """What the controller needs of a QP solver."""

    def solve(self, problem: QPProblem) -> QPSolution:
        """Return the solution of a program whose numbers are finite and bounds ordered."""

    def forget(self) -> None:
        """Start the next solve from nothing."""


def check_solver(name: str) -> None:
    """Raise ControlError unless `name` is a native solver or an installed backend of qpsolvers."""
    make_solver(name, 1, 0, 0, tolerance=1e-6, max_iterations=1)


def solver_names(name: str) -> tuple[str, ...]:
    """Return the solvers to ask one after the other: the one named, then the other native one."""
    if name not in _NATIVE:
        return (name,)
    others = [other for other in _NATIVE if other != name]
    return (name, *others)


def make_solver(
    name: str, n: int, n_eq: int, n_in: int, *, tolerance: float, max_iterations: int
) -> Solver:
    """Return a solver for programs of one size.

    Args:
        name: "proxqp" or "daqp" for the native ones, or any backend of qpsolvers.
        n, n_eq, n_in: size of the programs.
        tolerance: absolute, on residuals (native solvers).
        max_iterations: bound on inner and outer iterations (native solvers).

    Raises:
        ControlError: no such backend is installed.
    """
    if name == "proxqp":
        return ProxQPSolver(n, n_eq, n_in, tolerance=tolerance, max_iterations=max_iterations)
    if name == "daqp":
        return ActiveSetSolver(n, n_eq, n_in, tolerance=tolerance, max_iterations=max_iterations)
    return ForeignSolver(name)


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
            _PROXQP[info.status],
            int(info.iter),
        )

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._qp.cleanup()
        self._started = False


@final
class ActiveSetSolver:
    """Solves a sequence of programs of one size with daqp (Arnstrom, Bemporad & Axehill 2022).

    It finishes in a number of steps that grows with the constraints that bind and says at once
    when none can be met, but needs a positive definite H.
    """

    def __init__(
        self, n: int, n_eq: int, n_in: int, *, tolerance: float, max_iterations: int
    ) -> None:
        """Make room for programs of n variables, n_eq equalities and n_in inequalities."""
        self._n_eq = n_eq
        self._settings = {
            "primal_tol": tolerance,
            "dual_tol": tolerance,
            "iter_limit": max_iterations,
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
        x, _, flag, info = daqp.solve(
            H, g, self._rows, self._upper, self._lower, self._sense, **self._settings
        )
        multipliers = np.asarray(info["lam"])
        return QPSolution(
            np.asarray(x),
            multipliers[:n_eq],
            multipliers[n_eq:],
            _DAQP.get(int(flag), QPStatus.FAILED),
            int(info["iterations"]),
        )

    def forget(self) -> None:
        """Do nothing: every solve starts from nothing."""


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
