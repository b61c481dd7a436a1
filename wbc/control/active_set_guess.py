"""Solving a tick with the constraints that bound the last one, by one small linear system."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.control.program import ContactForceProgram
from wbc.control.qp import QPSolution, QPStatus
from wbc.control.task_stack import TaskStack

_ROUNDS = 4
_REFINEMENTS = 2
_ROOM = 24


class ActiveSetGuess:
    """Solves the contact-force program where few constraints bind and little has changed.

    Without inequalities, with the task rows A x + r = t and the equalities E x = e stacked in G,
    the Hessian of what remains is the diagonal D of regularisation and joint-selecting tasks, and

        (G D^-1 G' + diag(1, 0)) lambda = [t; e] - G D^-1 p,      x = D^-1 (p + G' lambda),

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
            tasks: whose rows are in the cost.
            tolerance: how much a row may be violated, and a multiplier have the wrong sign.
        """
        self._program, self._tasks, self._tolerance = program, tasks, tolerance
        k, e = len(tasks.target), len(program.b)
        self._task_rows, self._equal_rows, self._base = slice(0, k), slice(k, k + e), k + e
        n, total = program.n, k + e + _ROOM
        rows = program.rows
        self._first = rows.torque.stop
        self._C = rows.C[self._first :]
        self._lower, self._upper = rows.lower[self._first :], rows.upper[self._first :]
        self._G, self._scaled = np.zeros((total, n)), np.zeros((total, n))
        self._right = np.zeros(total)
        self._slack = np.zeros(total)
        self._slack[:k] = 1.0
        self._pull = np.zeros(n)
        self._inverse = np.zeros(n)
        self._weigh()
        self._active: list[int] = []
        self._upward: list[bool] = []

    def _weigh(self) -> None:
        """Take the diagonal of the Hessian, and the forces' part of the gradient."""
        program, nv = self._program, self._program.nv
        self._inverse[:nv] = 1.0 / (self._tasks.diagonal + program.weights[0])
        self._inverse[nv:] = 1.0 / program.force_cost.diagonal
        self._pull[nv:] = -program.force_cost.pull

    def learn(self, solution: QPSolution) -> None:
        """Take the constraints that bind in a solver's solution as the next guess."""
        push = solution.z[self._first : self._first + len(self._C)]
        active = np.flatnonzero(np.abs(push) > 10.0 * self._tolerance)
        self._active, self._upward = active.tolist(), (push[active] > 0.0).tolist()

    def solve(self) -> QPSolution | None:
        """Return the solution of the program as assembled, None where the guess fails."""
        program, tasks = self._program, self._tasks
        if program.force_cost.tracks:
            self._weigh()
        G, right = self._G, self._right
        G[self._task_rows, : program.nv] = tasks.matrix
        G[self._equal_rows] = program.A
        right[self._task_rows] = tasks.target
        right[self._equal_rows] = program.b
        self._pull[: program.nv] = tasks.pull
        free = self._pull * self._inverse
        for count in range(1, _ROUNDS + 1):
            found = self._with_active(free)
            if found is None:
                break
            x, force = found
            if not self._revise(x, force):
                return self._solution(x, force, count)
        self._active, self._upward = [], []
        return None

    def _with_active(self, free: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Return x and lambda for the active rows assumed, None where the rows are dependent."""
        base, active = self._base, self._active
        size = base + len(active)
        if size > len(self._right):
            return None
        if not size:
            return free, self._right[:0]
        G, right = self._G[:size], self._right[:size]
        if active:
            G[base:] = self._C[active]
            bounds = np.where(self._upward, self._upper[active], self._lower[active])
            right[base:] = bounds
        scaled = np.multiply(G, self._inverse, out=self._scaled[:size])
        system = scaled.dot(G.T)
        slack = self._slack[:size]
        system.reshape(-1)[:: size + 1] += slack
        gap = right - G.dot(free)
        factor, force, info = lapack.dposv(system.T, gap, overwrite_a=True)
        if info != 0:
            return None
        x = force.dot(scaled)
        x += free
        for _ in range(_REFINEMENTS):
            left = right - G.dot(x)
            left -= slack * force
            worst = abs(left).max()
            if worst <= self._tolerance:
                return x, force
            if not worst < np.inf:
                return None
            step, _ = lapack.dpotrs(factor, left)
            force += step
            x = force.dot(scaled)
            x += free
        return None

    def _revise(self, x: FloatArray, force: FloatArray) -> bool:
        """Correct the active rows by a solution; return whether any changed."""
        values = self._C.dot(x)
        over, under = values - self._upper, self._lower - values
        tolerance, active = self._tolerance, self._active
        worst = np.maximum(over, under)
        if active:
            worst[active] = 0.0
            pushes = force[self._base :].tolist()
            kept = [
                (-push if upward else push) >= -tolerance
                for push, upward in zip(pushes, self._upward, strict=True)
            ]
            if not all(kept):
                self._active = [row for row, keep in zip(active, kept, strict=True) if keep]
                self._upward = [up for up, keep in zip(self._upward, kept, strict=True) if keep]
        changed = len(self._active) != len(active)
        if worst.size and worst[worst.argmax()] > tolerance:
            broken = np.flatnonzero(worst > tolerance)
            self._active = self._active + broken.tolist()
            self._upward = self._upward + (over[broken] > under[broken]).tolist()
            changed = True
        return changed

    def _solution(self, x: FloatArray, force: FloatArray, rounds: int) -> QPSolution:
        push = np.zeros(len(self._program.rows.lower))
        if self._active:
            push[self._first :][self._active] = -force[self._base :]
        y = -force[self._equal_rows]
        return QPSolution(x, y, push, QPStatus.SOLVED, rounds)
