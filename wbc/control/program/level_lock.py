"""Keeping what the tasks of the more important level have obtained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.orthonormal_rows import extend_basis
from wbc.control.program.task_stack import TaskStack


class LevelLock:
    """Equality rows that hold the accelerations which more important levels decided.

    The tasks may ask for more than the robot has freedoms, and the contacts and the balance of the
    undriven coordinates take some of those away. Only what the tasks' rows add to the equalities
    is locked, as orthonormal rows: as many as there are decisions, however they were asked for,
    and none that could contradict another.
    """

    def __init__(self, program: ContactForceProgram, above: Sequence[TaskStack]) -> None:
        """Make room.

        Args:
            program: of the less important level.
            above: tasks of all more important levels; those without a weight decide nothing.
        """
        self._program, self._above = program, tuple(above)
        self._rows = np.zeros((greatest_lock(above), program.n))
        size = program.unlocked + len(self._rows)
        self._left, self._kept = np.zeros((size, program.n)), np.zeros((size, program.n))

    def assemble(self, solution: FloatArray) -> None:
        """Write the rows that hold what x (n,) of the level above gives its tasks.

        Call after the constraints of the program.
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
        rows = self._kept[first:last]
        program.assemble_lock(rows, rows @ solution)


def greatest_lock(above: Sequence[TaskStack]) -> int:
    """Return how many rows a lock of these tasks can have."""
    return sum(len(stack.wanted) + len(stack.chosen) for stack in above)
