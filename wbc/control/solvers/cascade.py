"""The controller's own solver and another one, behind one door and with one budget per tick."""

from __future__ import annotations

from time import perf_counter
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.solvers.budget import PROGRAM, foreign_iterations
from wbc.control.solvers.dual_active_set import DualActiveSet
from wbc.control.solvers.problem import BlockProblem, QPSolution, QPStatus
from wbc.control.solvers.solver import Solver, make_solver

# Share of the budget up to which the own solver may fail early, on rows that repeat each other;
# the other one has the rest.
_EARLY = 0.25

NEARBY = 0.4
"""Share of the budget that an allowed motion may take beside it, where the budget is spent.

On Talos (700 hostile ticks) 91 % of those that there are were found in 48 steps, 98 % in 64;
with 64 the worst tick takes a tenth longer than twenty good ones.
"""

# Share of the largest number in a program to which the other solver meets it. Beyond 1e7, with a
# tolerance of 1e-7, it solved none of 45 programs in 11 000 hostile ticks of Talos, and took
# 2 to 5 ms for each.
_ROUNDING = 1e-14

_CERTAIN = (QPStatus.SOLVED, QPStatus.INFEASIBLE)


@final
class Cascade:
    """Solves programs in blocks: first by `DualActiveSet`, where that gives up by another solver.

    The other solver is made when it is first asked, and anew when the number of equalities
    changes. `start_tick` opens the budget: once it is spent, a program is answered with
    ITERATION_LIMIT and is not solved, so that a tick takes bounded time without looking at a clock.

    Attributes:
        spent: [s] in the solvers since `start_tick`.
        count: programs given since then.
        iterations: of the solvers since then.
        blocking: row of C that the last program could not meet beside the others, -1 if unknown.
    """

    def __init__(
        self,
        own: DualActiveSet | None,
        name: str,
        *,
        own_first: bool,
        tolerance: float,
        max_iterations: int,
    ) -> None:
        """Take the solvers.

        Args:
            own: the controller's own solver, None where the program has no positive diagonal.
            name: of the other one, see `make_solver`.
            own_first: whether the own solver is asked first; otherwise it only says whether what
                the other could not solve has a solution.
            tolerance: of the other solver.
            max_iterations: of all solvers in one tick; ten times as many where the other one is
                asked first, which takes smaller steps. Behind the own solver it has as many as the
                rest of the budget pays for.
        """
        self._own, self._name, self._own_first = own, name, own_first
        self._tolerance = tolerance
        self._most = max_iterations if own_first else 10 * max_iterations
        self._size = -1, -1
        self._other: Solver | None = None
        self.start_tick()

    def start_tick(self, iterations: int = 0) -> None:
        """Open the budget, of which others have used some iterations."""
        self.spent, self.count, self.iterations, self.blocking = 0.0, 0, iterations, -1

    def forget(self) -> None:
        """Start the next solve from nothing."""
        if self._own is not None:
            self._own.forget()
        if self._other is not None:
            self._other.forget()

    @property
    def exhausted(self) -> bool:
        """Whether the budget is spent."""
        return self.iterations >= self._most

    def solve(self, problem: BlockProblem, *, starts_over: bool = False) -> QPSolution:
        """Return the solution, or one that is not SOLVED.

        The own solver first tries the rows that bound the last solution, unless it `starts_over`.
        """
        start = perf_counter()
        solution = self._solve(problem, starts_over)
        self.spent += perf_counter() - start
        self.count += 1
        return solution

    def _solve(self, problem: BlockProblem, starts_over: bool) -> QPSolution:
        self.blocking = -1
        self.iterations += PROGRAM
        if self.exhausted:
            return _nothing(problem)
        if self._own is None:
            return self._ask_other(problem)
        if self._own_first:
            solution = self._ask_own(self._own, problem, starts_over)
            if solution.status in _CERTAIN or self.iterations > _EARLY * self._most:
                return solution
            if float(np.abs(problem.right).max(initial=0.0)) > self._tolerance / _ROUNDING:
                return solution
            if self._other is not None:
                self._other.forget()  # else it may start twice, from the last program and anew
            return self._ask_other(problem)
        solution = self._ask_other(problem)
        if solution.status is QPStatus.ITERATION_LIMIT and not self.exhausted:
            verdict = self._ask_own(self._own, problem)
            if verdict.status is QPStatus.INFEASIBLE:
                return solution._replace(status=QPStatus.INFEASIBLE)
        return solution

    def nearest(self, problem: BlockProblem, x: FloatArray) -> QPSolution | None:
        """Return the point nearest to x (n,) that keeps the constraints, None if none is found.

        It has a budget of its own beyond that of the tick, see `NEARBY`.
        """
        if self._own is None:
            return None
        start = perf_counter()
        found = self._own.nearest(problem, x, int(NEARBY * self._most))
        self.spent += perf_counter() - start
        self.count += 1
        self.iterations += self._own.steps
        if found is None:
            return None
        return _nothing(problem)._replace(x=found, iterations=self._own.steps)

    def _ask_own(
        self, own: DualActiveSet, problem: BlockProblem, starts_over: bool = False
    ) -> QPSolution:
        solution = own.solve(problem, self._most - self.iterations, starts_over=starts_over)
        self.iterations += own.steps
        self.blocking = own.blocking
        return solution

    def _ask_other(self, problem: BlockProblem) -> QPSolution:
        if self.exhausted:
            return _nothing(problem)
        dense = problem.dense()
        size = len(dense.b), len(dense.lower)
        if self._other is None or size != self._size:
            self._size, most = size, self._most
            if self._own_first:
                rest = (1.0 - _EARLY) * most
                most = foreign_iterations(rest, len(dense.g), size[0])
            self._other = make_solver(
                self._name,
                len(dense.g),
                *size,
                tolerance=self._tolerance,
                max_iterations=most,
            )
        solution = self._other.solve(dense)
        self.iterations += solution.iterations if not self._own_first else self._most
        return solution


def _nothing(problem: BlockProblem) -> QPSolution:
    n, k = len(problem.pull), len(problem.right) - problem.soft
    empty = np.zeros(k), np.zeros(len(problem.lower))
    return QPSolution(np.full(n, np.nan), *empty, QPStatus.ITERATION_LIMIT, 0)
