"""Solving a tick with the constraints that bound the last one, by one small linear system."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.control.one_sided import OneSidedRows
from wbc.control.program import ContactForceProgram
from wbc.control.qp import QPSolution, QPStatus
from wbc.control.task_stack import TaskStack

ROOM = 24
"""How many constraints may bind besides the equalities."""

_ROUNDS = 4
_ROUNDING = 10.0  # equations of hundreds of newtons are met to 1e-6 N without a refinement
_REFINEMENTS = 2


class ActiveSetGuess:
    """Solves the contact-force program where few constraints bind and little has changed.

    Without inequalities, with the task rows A x + r = t and the equalities E x = e stacked in G,
    what remains of the Hessian is the diagonal D of regularisation and joint-selecting tasks, and

        (G D^-1 G' + diag(1/w, 0)) lambda = [t; e] - G D^-1 p,      x = D^-1 (p + G' lambda),

    a positive definite system as large as G has rows, a third to a half of the variables. Bounds
    that bind are further rows of G. Starting from those of the last tick, rows that are violated
    are added and rows that pull instead of push are dropped (the primal-dual active set method of
    Hintermueller, Ito & Kunisch, 2003) until nothing changes: then x is the solution, as every
    condition of optimality has been checked. If that takes more than a few rounds, or the rows
    depend on one another, the guess has failed and a solver must do it.

    Torque limits are not among the inequalities here; who asks must check them.
    """

    def __init__(self, program: ContactForceProgram, tasks: TaskStack, tolerance: float) -> None:
        """Make room.

        Args:
            program: what is to be solved, without efforts and without rows handed down.
            tasks: whose rows are in the cost, all with a weight.
            tolerance: how much a row may be violated, and a multiplier have the wrong sign.
        """
        self._program, self._tasks, self._tolerance = program, tasks, tolerance
        k, base = len(tasks.wanted), len(tasks.wanted) + len(program.b)
        self._residual = (_ROUNDING * tolerance) ** 2
        self._base, self._equalities = base, slice(k, base)
        self._G, self._right = program.stacked, program.stacked_right
        self._task_rows = self._G[:k, : program.nv]
        self._task_right = self._right[:k]
        self._scaled = np.zeros_like(self._G)
        self._softness = np.zeros(len(self._right))
        self._softness[:k] = tasks.softness
        self._system = np.zeros((base, base))
        self._diagonal = self._system.reshape(-1)[:: base + 1]
        self._bounds = OneSidedRows(program.rows)
        self._free, self._inverse = np.zeros(program.n), np.zeros(program.n)
        self._free_motion = self._free[: program.nv]
        self._inverse_motion = self._inverse[: program.nv]
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
        tasks = self._tasks
        if self._program.force_cost.tracks:
            self._weigh()
        np.copyto(self._task_rows, tasks.jacobian)
        np.copyto(self._task_right, tasks.wanted)
        np.multiply(tasks.pull, self._inverse_motion, out=self._free_motion)
        self._bounds.update()
        for count in range(1, _ROUNDS + 1):
            found = self._with_active()
            if found is None:
                break
            x, force = found
            if not self._revise(x, force):
                return self._solution(x, force, count)
        self._active = []
        return None

    def _with_active(self) -> tuple[FloatArray, FloatArray] | None:
        """Return x and lambda for the active rows assumed, None where the rows are dependent."""
        base, active = self._base, self._active
        size = base + len(active)
        if size > len(self._right):
            return None
        if not size:
            return self._free.copy(), self._right[:0]
        G, right, softness = self._G[:size], self._right[:size], self._softness[:size]
        if active:
            G[base:] = self._bounds.rows[active]
            right[base:] = self._bounds.bounds[active]
        scaled = np.multiply(G, self._inverse, out=self._scaled[:size])
        if active:
            system = scaled.dot(G.T)
            system.reshape(-1)[:: size + 1] += softness
        else:
            system = scaled.dot(G.T, out=self._system)
            self._diagonal += softness
        factor, force, info = lapack.dposv(system.T, right - G.dot(self._free), overwrite_a=True)
        if info != 0:
            return None
        for _ in range(_REFINEMENTS):
            x = force.dot(scaled)
            x += self._free
            left = right - G.dot(x)
            left -= softness * force
            if left.dot(left) <= self._residual:
                return x, force
            step, _ = lapack.dpotrs(factor, left)
            force += step
        return None

    def _revise(self, x: FloatArray, force: FloatArray) -> bool:
        """Correct the active rows by a solution; return whether any changed."""
        bounds, tolerance, active = self._bounds, self._tolerance, self._active
        beyond = bounds.rows.dot(x)
        beyond -= bounds.bounds
        if active:
            beyond[active] = 0.0
            pushes = force[self._base :].tolist()
            self._active = [
                row for row, push in zip(active, pushes, strict=True) if push <= tolerance
            ]
        changed = len(self._active) != len(active)
        if beyond.size and beyond.item(beyond.argmax()) > tolerance:
            self._active = self._active + np.flatnonzero(beyond > tolerance).tolist()
            changed = True
        return changed

    def _solution(self, x: FloatArray, force: FloatArray, rounds: int) -> QPSolution:
        push = np.zeros(len(self._program.rows.lower))
        if self._active:
            bounds = self._bounds
            push[bounds.source[self._active]] = -bounds.sign[self._active] * force[self._base :]
        return QPSolution(x, -force[self._equalities], push, QPStatus.SOLVED, rounds)
