"""The controller's own solver: the constraints that bound the last solution, then a dual method."""

from __future__ import annotations

from typing import Any, final

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.control.solvers.budget import ROUNDS, UNIT, system_work, units
from wbc.control.solvers.dual_steps import (
    CLIMB,
    CONTRADICTION,
    SOLVED,
    UNFINISHED,
    UNMET,
    climb_fixed,
)
from wbc.control.solvers.problem import BlockProblem, QPSolution, QPStatus
from wbc.control.solvers.row_system import (
    SYSTEM,
    place_blocks,
    settle,
    settle_fixed,
)
from wbc.fixed_arrays import FixedArrays

# Units of a guess: with one foot of Solo12 in the air and noise in the state one tick in a hundred
# takes more than 274 us without, 269 us with 4, 129 us with 8, 147 us with 16, 129 us with 32.
_SHORT = 8
_ENDED = {
    SOLVED: QPStatus.SOLVED,
    CONTRADICTION: QPStatus.INFEASIBLE,
    UNFINISHED: QPStatus.ITERATION_LIMIT,
    UNMET: QPStatus.FAILED,
}
_ROUNDING = 10.0  # equations of hundreds of newtons are met to 1e-6 N without a refinement


@final
class DualActiveSet:
    """Solves programs in blocks whose diagonal is positive, one like the last.

    Without inequalities, with the rows G x + S y = t and the diagonal D,

        (G D^-1 G' + S) lambda = t - G D^-1 p,      x = D^-1 (p + G' lambda),

    a positive definite system as large as G has rows: a third to a half of the variables. Bounds
    that bind are further hard rows of G. Starting from those of the last solution, rows that are
    violated are added and rows that pull instead of push are dropped (the primal-dual active set
    method of Hintermueller, Ito & Kunisch, 2003). If this does not settle in a few rounds, the
    rows that bind are found one by one from the optimum without any (Goldfarb & Idnani, 1983),
    which ends in any case, with the solution or with a row that contradicts the others. Either way
    the solution comes from the small system, whose residual is checked.

    Attributes:
        steps: what the last call took of a tick's budget, see `UNIT`.
        blocking: row that could not be met beside the others, -1 where there was none.
    """

    def __init__(
        self,
        n: int,
        rows: int,
        inequalities: int,
        more: int = 0,
        *,
        tolerance: float,
        max_iterations: int,
    ) -> None:
        """Make room.

        Args:
            n: number of variables.
            rows: greatest number of rows of G.
            inequalities: number of rows of C.
            more: bounds that may be further rows of G; they count as bounds that bind.
            tolerance: how far a row may be beyond its bound, and a push below zero.
            max_iterations: budget of a solve, see `UNIT`.
        """
        self._tolerance, self._most = tolerance, max_iterations
        system = system_work(n, rows)
        self._systems = [units(count * system) for count in range(ROUNDS + 1)]
        self._allowed = (_ROUNDING * tolerance) ** 2
        room, size = n, rows + more + n
        self._rows = np.zeros((size, n)), np.zeros(size), np.zeros(size)
        self._diagonal = np.zeros(n), np.zeros(n)
        self._force, self._values = np.zeros(size), np.zeros(inequalities)
        self._memory = np.zeros((size, n)), np.zeros((size, size)), np.zeros(size)
        self._active = np.zeros(size, dtype=np.int_)
        self._taken = np.zeros(inequalities, dtype=np.int_)
        self._memory_of_rows = *self._rows, *self._diagonal
        taking: tuple[Any, ...] = self._force, self._values, self._active, self._taken
        self._memory_of_settling = taking + self._memory
        square, wide = np.zeros((room, room)), max(n + size, inequalities)
        self._memory_of_climbing = (
            *(*self._memory_of_rows, self._force, *self._memory, self._active, self._taken),
            *(np.zeros(room), np.zeros((room, n + size)), square, np.zeros((room, n))),
            np.zeros((10, wide)),
        )
        self._bounds: FloatArray | None = None
        self._climb: FixedArrays
        self._last: BlockProblem | None = None  # a second time it is worth describing
        self._fixed: FixedArrays | None = None
        self._reached = np.full(n, np.nan)
        self._known = 0  # rows of the present program whose factor is known
        self.steps, self.blocking = 0, -1

    def forget(self) -> None:
        """Start the next solve from no binding row."""
        self._taken[:] = 0

    def learn(self, z: FloatArray) -> None:
        """Take the rows that push in a solution, of multipliers z (r,), as the next guess."""
        self._taken[:] = np.where(np.abs(z) > 10.0 * self._tolerance, np.sign(z), 0.0)

    def guess(self, problem: BlockProblem, skipped: int = 0) -> QPSolution | None:
        """Return the solution if a few steps from the last binding rows find it, None otherwise.

        Its multipliers begin with `skipped` zeros, of rows that the problem leaves out.
        """
        self.steps, self.blocking = 0, -1
        self._recognise(problem)
        found = self._settled(problem, skipped)
        if found is None and self._climbed(problem, _SHORT) is QPStatus.SOLVED:
            found = self._settled(problem, skipped)
        if found is None:
            self.forget()
        return found

    def solve(
        self, problem: BlockProblem, most: int | None = None, *, starts_over: bool = False
    ) -> QPSolution:
        """Return the solution of a program of the size given on construction.

        The rows that bound the last solution are tried first, unless it `starts_over`. At most
        `most` units of the budget are spent, `max_iterations` where it is left out. INFEASIBLE
        where rows contradict one another, ITERATION_LIMIT after too many steps, both with the x
        reached; FAILED, with an x of NaN, where rounding leaves the rows unmet.
        """
        self.steps, self.blocking = 0, -1
        self._recognise(problem)
        if starts_over:
            self._take(problem)
        else:
            found = self._settled(problem)
            if found is not None:
                return found
        status = self._climbed(problem, self._most if most is None else most)
        if status is QPStatus.SOLVED:
            found = self._settled(problem)
            if found is not None:
                return found
            status = QPStatus.FAILED
        self.forget()
        n, k = problem.rows.shape[1], len(problem.right) - problem.soft
        empty = np.zeros(k), np.zeros(len(problem.lower))
        x = np.full(n, np.nan) if status is QPStatus.FAILED else self._reached
        return QPSolution(x, *empty, status, self.steps)

    def nearest(self, problem: BlockProblem, x: FloatArray, most: int) -> FloatArray | None:
        """Return the point nearest to x (n,) that keeps the constraints, None where none is found.

        Distances count by the diagonal. At most `most` units of the budget are spent.
        """
        self.steps, self.blocking = 0, -1
        closest = problem.nearest_to(x)
        self._take(closest)
        return self._reached if self._climbed(closest, most) is QPStatus.SOLVED else None

    def memory(self, problem: BlockProblem) -> tuple[IntArray, IntArray]:
        """Return the memory of SYSTEM and CLIMB for a program; it lives as long as this does."""
        self._recognise(problem)
        self._recognise(problem)
        self._describe_climb(problem)
        assert self._fixed is not None
        return self._fixed.table, self._climb.table

    @property
    def precision(self) -> tuple[float, float, int]:
        """Tolerance, square of what rows may miss, and multiplications of a short climb."""
        return self._tolerance, self._allowed, _SHORT * UNIT

    def took(self, before: int, after: int, work: int) -> int:
        """Take what a guess took, as `guess_fixed` tells it; return the units of the budget."""
        systems = self._systems
        self.steps, self.blocking = systems[before] + systems[after] + units(work), -1
        return self.steps

    def _take(self, problem: BlockProblem) -> None:
        """Copy what climbing needs of a program."""
        diagonal, pull, rows, right, softness, *_ = problem
        place_blocks(rows, right, softness, diagonal, pull, *self._rows, *self._diagonal)
        self._known = 0

    def _settled(self, problem: BlockProblem, skipped: int = 0) -> QPSolution | None:
        """Correct the binding rows a few times; return the solution where that ends."""
        x = np.empty(len(problem.pull))
        diagonal, pull, rows, right, softness, _, C, lower, upper, _ = problem
        if self._fixed is not None and problem is self._last:
            size, rounds, self._known = settle_fixed(
                self._fixed.table, self._tolerance, self._allowed, ROUNDS, self._known, x
            )
        else:
            size, rounds, self._known = settle(
                *(rows, right, softness, diagonal, pull, C, lower, upper),
                *(self._tolerance, self._allowed, ROUNDS, self._known),
                *self._memory_of_rows,
                x,
                *self._memory_of_settling,
            )
        self.steps += self._systems[rounds]
        if size >= 0:
            return self._solution(problem, x, size, skipped)
        self.forget()
        return None

    def _recognise(self, problem: BlockProblem) -> None:
        """Describe the memory of a program that comes a second time, as it will in every tick."""
        self._known = 0
        if problem is not self._last:
            self._last, self._fixed = problem, None
        elif self._fixed is None:
            diagonal, pull, rows, right, softness, _, C, lower, upper, _ = problem
            program = rows, right, softness, diagonal, pull, C, lower, upper
            own = self._memory_of_rows + self._memory_of_settling
            self._fixed = FixedArrays(SYSTEM, program + own)

    def _climbed(self, problem: BlockProblem, most: int) -> QPStatus:
        """Find the binding rows one by one; return how that ended."""
        x = np.empty(len(problem.pull))
        self._reached = x
        self._describe_climb(problem)
        ended, work, self.blocking = climb_fixed(
            *(self._climb.table, self._known, len(problem.right)),
            *(self._allowed, 0.5 * self._tolerance),
            *(most * UNIT, x),
        )
        self.steps += units(work)
        self._known = 0 if ended == UNMET else len(problem.right) // 2 * 2
        return _ENDED[ended]

    def _describe_climb(self, problem: BlockProblem) -> None:
        """Describe the memory that climbing needs, unless it is that of the last time."""
        if self._bounds is not problem.C:
            self._bounds = problem.C
            bounds: tuple[Any, ...] = problem.C, problem.lower, problem.upper
            self._climb = FixedArrays(CLIMB, bounds + self._memory_of_climbing)

    def _solution(
        self, problem: BlockProblem, x: FloatArray, size: int, skipped: int
    ) -> QPSolution:
        base, push = len(problem.right), np.zeros(skipped + len(problem.lower))
        if size > base:
            push[skipped + self._active[: size - base]] = -self._force[base:size]
        y = -self._force[problem.soft : base]
        if problem.hardens:
            y = np.concatenate([y, -self._force[problem.hard]])
        return QPSolution(x, y, push, QPStatus.SOLVED, self.steps)
