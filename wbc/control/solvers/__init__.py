"""Quadratic programs and their solvers."""

from wbc.control.solvers.daqp import ActiveSetSolver
from wbc.control.solvers.dual_active_set import DualActiveSet
from wbc.control.solvers.foreign import ForeignSolver
from wbc.control.solvers.problem import INFINITE, BlockProblem, QPProblem, QPSolution, QPStatus
from wbc.control.solvers.proxqp import ProxQPSolver
from wbc.control.solvers.solver import Solver, check_solver, make_solver

__all__ = [
    "INFINITE",
    "ActiveSetSolver",
    "BlockProblem",
    "DualActiveSet",
    "ForeignSolver",
    "ProxQPSolver",
    "QPProblem",
    "QPSolution",
    "QPStatus",
    "Solver",
    "check_solver",
    "make_solver",
]
