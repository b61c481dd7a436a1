"""Quadratic programs and their solvers."""

from wbc.control.qp.active_set import ActiveSetSolver
from wbc.control.qp.foreign import ForeignSolver
from wbc.control.qp.problem import INFINITE, QPProblem, QPSolution, QPStatus
from wbc.control.qp.proxqp import ProxQPSolver
from wbc.control.qp.solver import Solver, check_solver, make_solver

__all__ = [
    "INFINITE",
    "ActiveSetSolver",
    "ForeignSolver",
    "ProxQPSolver",
    "QPProblem",
    "QPSolution",
    "QPStatus",
    "Solver",
    "check_solver",
    "make_solver",
]
