"""Choosing a solver by name."""

from __future__ import annotations

from typing import Protocol

from wbc.control.solvers.daqp import ActiveSetSolver
from wbc.control.solvers.foreign import ForeignSolver
from wbc.control.solvers.problem import QPProblem, QPSolution
from wbc.control.solvers.proxqp import ProxQPSolver


class Solver(Protocol):
    """What the controller needs of a QP solver."""

    def solve(self, problem: QPProblem) -> QPSolution:
        """Return the solution of a program whose numbers are finite and bounds ordered."""

    def forget(self) -> None:
        """Start the next solve from nothing."""


def check_solver(name: str) -> None:
    """Raise ControlError unless `name` is a native solver or an installed backend of qpsolvers."""
    make_solver(name, 1, 0, 0, tolerance=1e-6, max_iterations=1)


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
