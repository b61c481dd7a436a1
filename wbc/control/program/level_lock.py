"""Keeping what the tasks of the more important level have obtained."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.orthonormal_rows import extend_basis
from wbc.control.program.task_stack import TaskStack


class LevelLock:
    """Equality rows that hold the accelerations which a level decided.

    The tasks may ask for more than the robot has freedoms, and the contacts and the balance of the
    undriven coordinates take some of those away. Only what the tasks' rows add to the equalities
    is locked, as orthonormal rows: as many as there are decisions, however they were asked for,
    and none that could contradict another.
    """

    def __init__(self, program: ContactForceProgram, above: TaskStack) -> None:
        """Make room.

        Args:
            program: of the less important level.
            above: tasks of the more important level; those without a weight decide nothing.
        """
        self._program, self._above = program, above
        self._chosen = above.chosen
        self._rows = np.zeros((greatest_lock(above), program.n))
        size = program.unlocked + len(self._rows)
        self._left, self._kept = np.zeros((size, program.n)), np.zeros((size, program.n))

    def assemble(self, solution: FloatArray) -> None:
        """Write the rows that hold what x (n,) of the level above gives its tasks.

        Call after the constraints of the program.
        """
        program, above, k = self._program, self._above, len(self._above.wanted)
        self._rows[:k, : program.nv] = above.jacobian * (above.weight > 0.0)[:, None]
        places = np.arange(k, len(self._rows))
        self._rows[places, self._chosen] = above.diagonal[self._chosen] > 0.0
        first = extend_basis(program.A[: program.unlocked], self._left, self._kept, 0)
        last = extend_basis(self._rows, self._left, self._kept, first)
        rows = self._kept[first:last]
        program.assemble_lock(rows, rows @ solution)


def greatest_lock(above: TaskStack) -> int:
    """Return how many rows a lock of these tasks can have."""
    return len(above.wanted) + len(above.chosen)
