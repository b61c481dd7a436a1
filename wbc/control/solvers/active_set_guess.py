"""Solving a tick with the constraints that bound the last one, by one small linear system."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.task_stack import TaskStack
from wbc.control.solvers import QPSolution, QPStatus
from wbc.control.solvers.one_sided import OneSidedRows
from wbc.control.solvers.row_system import excess, meet_rows, place_tasks

ROOM = 24
"""How many constraints may bind besides the equalities."""

_ROUNDS = 4
_ROUNDING = 10.0  # equations of hundreds of newtons are met to 1e-6 N without a refinement


class ActiveSetGuess:
    """Solves the contact-force program where few constraints bind and little has changed.

    Without inequalities, with the rows A x + r = t of tasks and efforts and the equalities E x = e
    stacked in G, what remains of the Hessian is the diagonal D of regularisation and
    joint-selecting tasks, and

        (G D^-1 G' + diag(1/w, 0)) lambda = [t; e] - G D^-1 p,      x = D^-1 (p + G' lambda),

    a positive definite system as large as G has rows: without efforts and on level 0 a third to a
    half of the variables. Bounds that bind are further rows of G. Starting from those of the last
    tick, rows that are violated are added and rows that pull instead of push are dropped (the
    primal-dual active set method of Hintermueller, Ito & Kunisch, 2003) until nothing changes:
    then x is the solution, as every condition of optimality has been checked. If that takes more
    than a few rounds, or the rows depend on one another, the guess has failed and a solver must do
    it.

    Torque limits are not among the inequalities here; who asks must check them.
    """

    def __init__(self, program: ContactForceProgram, tasks: TaskStack, tolerance: float) -> None:
        """Make room.

        Args:
            program: what is to be solved.
            tasks: whose rows are in the cost, all with a weight.
            tolerance: how much a row may be violated, and a multiplier have the wrong sign.
        """
        self._program, self._tasks, self._tolerance = program, tasks, tolerance
        k = len(tasks.wanted)
        self._allowed = (_ROUNDING * tolerance) ** 2
        self._base = 0
        self._G, self._right = program.stacked, program.stacked_right
        size = len(self._right)
        self._softness = np.zeros(size)
        self._softness[:k], self._softness[k : program.cost_rows] = tasks.softness, 1.0
        self._bounds = OneSidedRows(program.rows)
        self._free, self._inverse = np.zeros(program.n), np.zeros(program.n)
        self._force, self._beyond = np.zeros(size), np.zeros(len(self._bounds.bounds))
        self._memory = np.zeros_like(self._G), np.zeros((size, size)), np.zeros(size)
        self._weigh()
        self._active: list[int] = []

    def _weigh(self) -> None:
        """Take the diagonal of the Hessian, and where it alone would put the forces."""
        program, nv = self._program, self._program.nv
        self._inverse[:nv] = 1.0 / (self._tasks.diagonal + program.weights[0])
        self._inverse[nv:] = 1.0 / program.force_cost.diagonal
        self._free[nv:] = -program.force_cost.pull * self._inverse[nv:]

    def learn(self, solution: QPSolution) -> None:
        """Take the constraints that bind in a solver's solution as the next guess."""
        bounds = self._bounds
        push = solution.z[bounds.source] * bounds.sign
        self._active = np.flatnonzero(push > 10.0 * self._tolerance).tolist()

    def solve(self) -> QPSolution | None:
        """Return the solution of the program as assembled, None where the guess fails."""
        tasks, tolerance = self._tasks, self._tolerance
        if self._program.force_cost.tracks:
            self._weigh()
        G, right, free, inverse = self._G, self._right, self._free, self._inverse
        place_tasks(tasks.jacobian, tasks.wanted, tasks.pull, inverse, G, right, free)
        self._base = self._program.cost_rows + len(self._program.b)
        bounds, x = self._bounds, np.empty(self._program.n)
        bounds.update()
        for count in range(1, _ROUNDS + 1):
            size = self._add_active()
            if size > len(right) or not meet_rows(
                *(G, right, self._softness, inverse, free, size, self._allowed),
                *(x, self._force, *self._memory),
            ):
                break
            worst = excess(bounds.rows, bounds.bounds, x, self._beyond)
            if (not self._active and worst <= tolerance) or not self._revise():
                return self._solution(x, count)
        self._active = []
        return None

    def _add_active(self) -> int:
        """Write the rows assumed active below the others; return how many rows there are."""
        base, active = self._base, self._active
        size = base + len(active)
        if active and size <= len(self._right):
            self._G[base:size] = self._bounds.rows[active]
            self._right[base:size] = self._bounds.bounds[active]
        return size

    def _revise(self) -> bool:
        """Correct the active rows by the last solution; return whether any changed."""
        tolerance, active, beyond = self._tolerance, self._active, self._beyond
        beyond[active] = 0.0
        pushes = self._force[self._base : self._base + len(active)].tolist()
        kept = [row for row, push in zip(active, pushes, strict=True) if push <= tolerance]
        added = np.flatnonzero(beyond > tolerance).tolist()
        self._active = kept + added
        return bool(added) or len(kept) != len(active)

    def _solution(self, x: FloatArray, rounds: int) -> QPSolution:
        base, active = self._base, self._active
        push = np.zeros(len(self._program.rows.lower))
        if active:
            bounds = self._bounds
            pushes = self._force[base : base + len(active)]
            push[bounds.source[active]] = -bounds.sign[active] * pushes
        pull = -self._force[self._program.cost_rows : base]
        return QPSolution(x, pull, push, QPStatus.SOLVED, rounds)
