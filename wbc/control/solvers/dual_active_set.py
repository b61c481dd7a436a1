"""The controller's own solver: the constraints that bound the last solution, then a dual method."""

from __future__ import annotations

from typing import final

import numpy as np

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.control.solvers.budget import ROUNDS, UNIT, system_work, units
from wbc.control.solvers.dual_solve import solve_fixed
from wbc.control.solvers.dual_steps import (
    CLIMB,
    CONTRADICTION,
    SOLVED,
    UNFINISHED,
    UNMET,
    climb_fixed,
)
from wbc.control.solvers.problem import BlockProblem, QPSolution, QPStatus
from wbc.control.solvers.row_system import SYSTEM, place_blocks, place_pushing
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
_SOLVED = QPStatus.SOLVED
_PROGRAM, _BOUNDS = 8, 3  # arrays of a program in SYSTEM and in CLIMB
_MANY = 64  # programs described at a time: those of lower levels come in many sizes
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
        self._blocks = np.zeros((size, n)), *np.zeros((2, size)), *np.zeros((2, n))
        self._force, self._taken = np.zeros(size), np.zeros(inequalities, dtype=np.int_)
        active, values = np.zeros(size, dtype=np.int_), np.zeros(inequalities)
        factor = np.zeros((size, n)), np.zeros((size, size)), np.zeros(size)
        settling = self._force, values, active, self._taken, *factor
        square, wide = np.zeros((room, room)), max(n + size, inequalities)
        climbing = np.zeros(room), np.zeros((room, n + size)), square, np.zeros((room, n))
        directions = np.zeros((size, size)), np.zeros((size, size)), np.zeros((n, size))
        kept = self._force, *factor, active, self._taken
        self._system = FixedArrays(SYSTEM[_PROGRAM:], self._blocks + settling)
        self._climb = FixedArrays(
            CLIMB[_BOUNDS:], (*self._blocks, *kept, *climbing, np.zeros((11, wide)), *directions)
        )
        self._described: dict[int, tuple[BlockProblem, FixedArrays, IntArray, IntArray]] = {}
        self.steps, self.blocking = 0, -1

    def forget(self) -> None:
        """Start the next solve from no binding row."""
        self._taken[:] = 0

    def learn(self, z: FloatArray) -> None:
        """Take the rows that push in a solution, of multipliers z (r,), as the next guess."""
        place_pushing(z, 10.0 * self._tolerance, self._taken)

    def guess(self, problem: BlockProblem, skipped: int = 0) -> QPSolution | None:
        """Return the solution if a few steps from the last binding rows find it, None otherwise.

        Its multipliers begin with `skipped` zeros, of rows that the problem leaves out.
        """
        status, x, y, z = self._run(problem, _SHORT, False, skipped)
        return QPSolution(x, y, z, _SOLVED, self.steps) if status is _SOLVED else None

    def solve(
        self, problem: BlockProblem, most: int | None = None, *, starts_over: bool = False
    ) -> QPSolution:
        """Return the solution of a program of the size given on construction.

        The rows that bound the last solution are tried first, unless it `starts_over`. At most
        `most` units of the budget are spent, `max_iterations` where it is left out. INFEASIBLE
        where rows contradict one another, ITERATION_LIMIT after too many steps, both with the x
        reached; FAILED, with an x of NaN, where rounding leaves the rows unmet.
        """
        status, x, y, z = self._run(problem, self._most if most is None else most, starts_over, 0)
        if status is not _SOLVED:
            y[:], z[:] = 0.0, 0.0
        if status is QPStatus.FAILED:
            x[:] = np.nan
        return QPSolution(x, y, z, status, self.steps)

    def nearest(self, problem: BlockProblem, x: FloatArray, most: int) -> FloatArray | None:
        """Return the point nearest to x (n,) that keeps the constraints, None where none is found.

        Distances count by the diagonal. At most `most` units of the budget are spent.
        """
        diagonal, pull, rows, right, softness, *_ = closest = problem.nearest_to(x)
        place_blocks(rows, right, softness, diagonal, pull, *self._blocks)
        found = np.empty(len(x))
        climbing, size, tolerance = self.memory(problem)[1], len(closest.right), self._tolerance
        ended, work, self.blocking = climb_fixed(
            climbing, 0, size, self._allowed, 0.5 * tolerance, most * UNIT, found
        )
        self.steps = units(work)
        return found if ended == SOLVED else None

    def memory(self, problem: BlockProblem) -> tuple[IntArray, IntArray]:
        """Return the memory of SYSTEM and CLIMB for a program; it lives as long as this does."""
        known = self._described.get(id(problem))
        if known is None or known[0] is not problem:
            diagonal, pull, rows, right, softness, _, C, lower, upper, _ = problem
            program = rows, right, softness, diagonal, pull, C, lower, upper
            made = FixedArrays(SYSTEM[:_PROGRAM], program)
            bounds = made.table[_PROGRAM - _BOUNDS :]
            system = frozen(np.vstack([made.table, self._system.table]), np.int64)
            climb = frozen(np.vstack([bounds, self._climb.table]), np.int64)
            known = problem, made, system, climb
            if len(self._described) == _MANY:
                self._described.clear()
            self._described[id(problem)] = known
        return known[2], known[3]

    @property
    def precision(self) -> tuple[float, float, int]:
        """Tolerance, square of what rows may miss, and multiplications of a short climb."""
        return self._tolerance, self._allowed, _SHORT * UNIT

    def took(self, before: int, after: int, work: int, blocking: int = -1) -> int:
        """Take what `solve_fixed` took, as it tells; return the units of the budget."""
        systems = self._systems
        self.steps, self.blocking = systems[before] + systems[after] + units(work), blocking
        return self.steps

    def _run(
        self, problem: BlockProblem, most: int, starts_over: bool, skipped: int
    ) -> tuple[QPStatus, FloatArray, FloatArray, FloatArray]:
        """Solve a program with `most` units; return how that ended, x, y and z."""
        x, z = np.empty(len(problem.pull)), np.empty(skipped + len(problem.lower))
        y = np.empty(len(problem.right) - problem.soft)
        system, climbing = self.memory(problem)
        ended, before, after, work, blocking = solve_fixed(
            system,
            climbing,
            self._tolerance,
            self._allowed,
            most * UNIT,
            int(starts_over),
            problem.soft,
            skipped,
            x,
            y,
            z,
        )
        self.took(before, after, work, blocking)
        if problem.hardens:
            y = np.concatenate([y, -self._force[problem.hard]])
        return _ENDED[ended], x, y, z
