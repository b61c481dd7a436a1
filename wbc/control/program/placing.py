"""Rows of tasks in the memory of a program, compiled."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Dense,
    Matrix,
    Number,
    OutDense,
    OutMatrix,
    OutVector,
    Places,
    Row,
    Vector,
    compiled,
)
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.output_torques import OutputTorques
from wbc.control.program.balance import place_balance
from wbc.control.program.task_stack import TaskStack
from wbc.fixed_arrays import FixedArrays, FixedTable, array_at


@compiled(Number, Matrix, *[Vector] * 5, Number, OutDense, *[OutVector] * 4)
def place_tasks(
    jacobian: FloatArray,
    wanted: FloatArray,
    weight: FloatArray,
    chosen: FloatArray,
    chosen_pull: FloatArray,
    equalities: FloatArray,
    regularisation: float,
    rows: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    diagonal: FloatArray,
    pull: FloatArray,
) -> float:
    """Write task rows (k, nv) = `wanted` (k,), and the diagonal of the accelerations (nv,).

    Rows of no weight are left out: the others stand together, the last one in place k - 1.

    Args:
        jacobian, wanted, weight: of the tasks with rows.
        chosen, chosen_pull: weights (nv,) of the tasks that select joints, and weighted wanted.
        equalities: what the equalities must be (e,).
        regularisation: of the accelerations, added to `chosen`.
        rows, right, softness: results (.., n), (..,), (..,).
        diagonal, pull: results (n,).

    Returns:
        the sum of the sizes of everything wanted, and of the equalities.
    """
    nv, place = len(chosen), len(wanted)
    total = 0.0
    for i in range(len(wanted) - 1, -1, -1):
        total += abs(wanted[i])
        if weight[i] > 0.0:
            place -= 1
            right[place], softness[place] = wanted[i], 1.0 / weight[i]
            for j in range(nv):
                rows[place, j] = jacobian[i, j]
    for j in range(nv):
        diagonal[j] = chosen[j] + regularisation
        pull[j] = chosen_pull[j]
        total += abs(pull[j])
    for i in range(len(equalities)):
        total += abs(equalities[i])
    return total


TASKS = Matrix, *[Vector] * 5, OutDense, *[OutVector] * 4
"""Kinds of the arrays of `place_tasks`, in its order."""


@compiled(Number, FixedTable, Number)
def place_tasks_fixed(memory: IntArray, regularisation: float) -> float:
    """Do as `place_tasks` does in the memory of TASKS."""
    return place_tasks(
        array_at(memory, 0, Matrix),
        array_at(memory, 1, Vector),
        array_at(memory, 2, Vector),
        array_at(memory, 3, Vector),
        array_at(memory, 4, Vector),
        array_at(memory, 5, Vector),
        regularisation,
        array_at(memory, 6, OutDense),
        array_at(memory, 7, OutVector),
        array_at(memory, 8, OutVector),
        array_at(memory, 9, OutVector),
        array_at(memory, 10, OutVector),
    )


PROGRAM = Dense, Row, Matrix, Places, OutMatrix, OutVector, FixedTable
"""Kinds of the arrays of `place_balance`, in its order, and the memory of TASKS."""


@compiled(Number, FixedTable, Number, Number)
def place_program(memory: IntArray, scale: float, regularisation: float) -> float:
    """Do as `place_balance` and `place_tasks` do in the memory of PROGRAM."""
    place_balance(
        array_at(memory, 0, Dense),
        array_at(memory, 1, Row),
        array_at(memory, 2, Matrix),
        scale,
        array_at(memory, 3, Places),
        array_at(memory, 4, OutMatrix),
        array_at(memory, 5, OutVector),
    )
    return place_tasks_fixed(array_at(memory, 6, FixedTable), regularisation)


class Placing:
    """Writes the balance and the tasks of a program into its rows."""

    def __init__(
        self,
        plant: OutputTorques,
        contacts: ContactSet,
        balance: FloatArray,
        balance_right: FloatArray,
        results: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
    ) -> None:
        """Take the memory.

        Args:
            plant: the dynamics.
            contacts: the active contacts.
            balance, balance_right: rows (u, n) and (u,) of the undriven coordinates.
            results: of `place_tasks`.
        """
        self._plant, self._contacts = plant, contacts
        self._balance, self._results = (balance, balance_right), results
        self._mass = self._bias = np.zeros(0)
        self._fixed: tuple[FixedArrays, FixedArrays]

    def place_balance(self, scale: float) -> None:
        """Write the balance of the undriven coordinates, with `scale` [N] per force variable."""
        plant = self._plant
        place_balance(
            *(plant.mass, plant.bias, self._contacts.jacobian, scale),
            *(plant.robot.unactuated, *self._balance),
        )

    def place(
        self,
        tasks: TaskStack,
        equalities: FloatArray,
        scale: float,
        regularisation: float,
        *,
        fixed: bool,
    ) -> float:
        """Write balance and tasks; return the sum of the sizes of all that is wanted.

        Args:
            tasks: of the level.
            equalities: what the equalities must be (e,).
            scale: [N] per unit of force variable.
            regularisation: of the accelerations.
            fixed: whether the equalities stay where they are; otherwise the balance must stand.
        """
        if fixed:
            return place_program(self.memory(tasks, equalities), scale, regularisation)
        return place_tasks(*_asked(tasks, equalities), regularisation, *self._results)

    def memory(self, tasks: TaskStack, equalities: FloatArray) -> IntArray:
        """Return the memory of PROGRAM, described anew where the plant's has moved."""
        plant = self._plant
        if plant.bias is not self._bias or plant.mass is not self._mass:
            self._mass, self._bias = plant.mass, plant.bias
            asked = FixedArrays(TASKS, _asked(tasks, equalities) + self._results)
            moved = plant.mass, plant.bias, self._contacts.jacobian, plant.robot.unactuated
            self._fixed = FixedArrays(PROGRAM, (*moved, *self._balance, asked.table)), asked
        return self._fixed[0].table


def _asked(
    tasks: TaskStack, equalities: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what tasks and equalities want."""
    rows = tasks.jacobian, tasks.wanted, tasks.weight
    return *rows, tasks.diagonal, tasks.pull, equalities
