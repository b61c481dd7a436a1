"""The solvers behind the controller's own guess: ProxQP and daqp."""

from __future__ import annotations

from enum import Enum
from math import isqrt

import daqp
import numpy as np
from proxsuite import proxqp

from wbc.arrays import FloatArray
from wbc.control.qp.problem import QPProblem, QPSolution, QPStatus
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
_SOLVERS = ("proxqp", "daqp")


class WarmStart(Enum):
    """What a tick takes over from the last one.

    ACTIVE_SET tries the constraints that bound the last solution, in one small linear system whose
    solution is taken if it fulfils every condition of optimality; the solver is asked otherwise.
    SOLVER always asks the solver, which starts from nothing.
    """

    ACTIVE_SET = "active_set"
    SOLVER = "solver"


def check_solver(name: str) -> None:
    """Raise ControlError unless `name` is that of a solver."""
    if name not in _SOLVERS:
        raise ControlError(unknown_name("QP solver", name, _SOLVERS))


def solver_names(name: str) -> tuple[str, ...]:
    """Return the solvers to ask one after the other: the one named, and daqp behind ProxQP.

    ProxQP finds nothing where daqp does not: of 200 hostile ticks of Talos daqp failed in ten, and
    ProxQP took 10 ms each to say the same.
    """
    return (name, "daqp") if name == "proxqp" else (name,)


def solve(
    name: str,
    problem: QPProblem,
    *,
    tolerance: float,
    most: int,
    give: FloatArray | None = None,
) -> QPSolution:
    """Return the solution of a program whose numbers are finite and bounds ordered, from nothing.

    daqp rounds as its memory happens to lie. Started from bounds of another program, it may end
    with other bounds then, so that ticks would not repeat.

    Args:
        name: "proxqp" or "daqp".
        problem: the program.
        tolerance: absolute, on residuals.
        most: iterations, inner and outer ones together.
        give: softness (n_in,) of the bounds: one that is passed costs (beyond)^2 / 2 softness. Zero
            for one that must be kept; without it all must be.
    """
    n = len(problem.g)
    if give is not None and give.any():
        problem = _with_passings(problem, give)
    if name == "daqp":
        found = _solve_daqp(problem, tolerance, most)
    else:
        found = _solve_proxqp(problem, tolerance, most)
    return found if len(found.x) == n else found._replace(x=found.x[:n])


def _with_passings(problem: QPProblem, give: FloatArray) -> QPProblem:
    """Return a program with, behind x (n,), how far every bound that gives is passed."""
    H, g, A, b, C, lower, upper = problem
    gives = np.flatnonzero(give)
    n, more = len(g), len(gives)
    whole = np.zeros((n + more, n + more))
    whole[:n, :n], whole[n:, n:] = H, np.diag(1.0 / give[gives])
    A, C = np.hstack([A, np.zeros((len(b), more))]), np.hstack([C, np.zeros((len(C), more))])
    C[gives, n + np.arange(more)] = -1.0
    return QPProblem(whole, np.concatenate([g, np.zeros(more)]), A, b, C, lower, upper)


def _solve_proxqp(problem: QPProblem, tolerance: float, most: int) -> QPSolution:
    """Solve with proxsuite's dense ProxQP; it would not return where bounds are not ordered.

    The duality gap is part of the stopping rule: without it a point that is feasible and
    stationary, but pushes against a bound that is elsewhere, may be returned as the solution.
    """
    H, g, A, b, C, lower, upper = problem
    backend = proxqp.dense.DenseBackend.PrimalDualLDLT
    qp = proxqp.dense.QP(len(g), len(b), len(lower), dense_backend=backend)
    settings = qp.settings
    settings.eps_abs, settings.eps_rel = tolerance, 0.0
    settings.check_duality_gap = True
    settings.eps_duality_gap_abs = 10.0 * tolerance
    settings.eps_duality_gap_rel = tolerance
    settings.eps_primal_inf = 1e-14
    settings.max_iter = max(isqrt(2 * most), 1)
    settings.max_iter_in = max(most // settings.max_iter, 1)
    qp.init(H, g, A, b, C, lower, upper)
    qp.solve()
    found, info = qp.results, qp.results.info
    x, y, z = np.array(found.x), np.array(found.y), np.array(found.z)
    return QPSolution(x, y, z, _PROXQP[info.status], int(info.iter))


def _solve_daqp(problem: QPProblem, tolerance: float, most: int) -> QPSolution:
    """Solve with daqp (Arnstrom, Bemporad & Axehill 2022), which needs a positive definite H.

    It finishes in a number of steps that grows with the constraints that bind, and says at once
    when none can be met.
    """
    H, g, A, b, C, lower, upper = problem
    sense = np.zeros(len(b) + len(lower), dtype=np.int32)
    sense[: len(b)] = _EQUALITY
    rows, low, high = np.vstack([A, C]), np.concatenate([b, lower]), np.concatenate([b, upper])
    limits = {"primal_tol": tolerance, "dual_tol": tolerance, "iter_limit": most}
    x, _, flag, info = daqp.solve(H, g, rows, high, low, sense, **limits)
    multipliers = np.asarray(info["lam"])
    y, z = multipliers[: len(b)], multipliers[len(b) :]
    status = _DAQP.get(int(flag), QPStatus.FAILED)
    return QPSolution(np.asarray(x), y, z, status, int(info["iterations"]))
