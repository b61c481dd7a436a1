"""Keeping what the tasks of the more important level have obtained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.rows.implied_rows import find_implied, gather_binding
from wbc.control.program.rows.orthonormal_rows import extend_basis
from wbc.control.program.task_stack import TaskStack

# Half an angle, of a wedge that counts as closed: what is free is measured by what it costs, as a
# dual method does. With 3e-5 all of 2080 ticks of Talos are solved and the cost is at most 0.5 %
# larger than with the wedge open, with 1e-5 six are not, and with 1e-4 it is 0.6 % on fewer states.
_NARROW = 3e-5
# Tolerances within which a bound counts as reached.
_REACH = 30.0


class LevelLock:
    """Equality rows that hold the accelerations which more important levels decided.

    The tasks may ask for more than the robot has freedoms, and the contacts and the balance of the
    undriven coordinates take some of those away. Only what the tasks' rows add to the equalities
    is locked, as orthonormal rows: as many as there are decisions, however they were asked for,
    and none that could contradict another.

    Where bounds kept the tasks from more, most of these bounds cannot be left either without losing
    something of the tasks (Escande, Mansard & Wieber, 2014): rows that add up to nothing with
    positive weights. As inequalities they have no room between them, and pushes without limit.
    They are locked as well, and are no bounds any more.
    """

    def __init__(
        self,
        program: ContactForceProgram,
        tasks: TaskStack,
        above: Sequence[TaskStack],
        tolerance: float,
    ) -> None:
        """Make room.

        Args:
            program: of the less important level.
            tasks: of that level.
            above: tasks of all more important levels; those without a weight decide nothing.
            tolerance: of the solvers.
        """
        self._program, self._tasks, self._above = program, tasks, tuple(above)
        self._reach = _REACH * tolerance
        n, most = program.n, len(program.rows.lower)
        self._rows = np.zeros((greatest_lock(above), n))
        size = program.unlocked + max(len(self._rows), n)
        self._left = np.zeros((max(size, most), n))
        self._kept, self._scaled = np.zeros((size, n)), np.zeros((size, n))
        self._binding = np.zeros((most, n))
        square = np.zeros((most, most)), np.zeros((most, most))
        places = np.zeros(most, dtype=np.int_)
        single = np.zeros(most), np.zeros(most), np.zeros(most, dtype=np.int_)
        self._memory = places, np.zeros((most, n)), *square, *single

    def assemble(self, solution: FloatArray, *, limited: bool) -> None:
        """Write the rows that hold what x (n,) of the level above gives its tasks.

        Call after the constraints of the program.

        Args:
            solution: x (n,).
            limited: whether torque limits may bind; their rows are then those of x.
        """
        program, start = self._program, 0
        for above in self._above:
            stop = start + len(above.wanted)
            active = (above.weight > 0.0)[:, None]
            self._rows[start:stop, : program.nv] = above.jacobian * active
            start = stop + len(above.chosen)
            places = np.arange(stop, start)
            self._rows[places, above.chosen] = above.diagonal[above.chosen] > 0.0
        first = extend_basis(program.A[: program.unlocked], self._left, self._kept, 0)
        last = extend_basis(self._rows, self._left, self._kept, first)
        last = self._extend_by_bounds(last, solution, limited)
        program.assemble_lock(self._kept[first:last], solution)

    def _extend_by_bounds(self, last: int, solution: FloatArray, limited: bool) -> int:
        """Add the bounds that are equalities; return how many rows there are."""
        rows, kept = self._program.rows, self._kept
        free, (low, high) = slice(0 if limited else rows.torque.stop, None), rows.stated
        weights = self._program.weights_of(self._tasks)
        binding, scales = self._binding, 1.0 / np.sqrt(weights)
        count = gather_binding(
            *(rows.C[free], low[free], high[free], solution, self._reach),
            *(scales, binding, self._memory[0]),
        )
        if not count:
            rows.decide(self._memory[0][:0])
            return last
        size = extend_basis(kept[:last] * scales, self._left, self._scaled, 0)
        known, found = 0, -1
        while found != known:
            known = max(found, 0)
            found = find_implied(binding, known, count, self._scaled, size, _NARROW, *self._memory)
            size = extend_basis(binding[known:found], self._left, self._scaled, size)
        rows.decide(self._memory[0][:found] + free.start)
        return extend_basis(binding[:found] / scales, self._left, kept, last)


def greatest_lock(above: Sequence[TaskStack]) -> int:
    """Return how many rows a lock of these tasks can have."""
    return sum(len(stack.wanted) + len(stack.chosen) for stack in above)
