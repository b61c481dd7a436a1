"""All tasks of one level, stacked into one weighted least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Reference
from wbc.control.tasks import Task
from wbc.robot import Robot

_NOTHING = Reference()


class TaskStack:
    """Weighted rows W J qdd = W (wanted - drift), refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows.

    Attributes:
        matrix: sqrt(w) J (k, nv) of the tasks with rows.
        target: sqrt(w) (wanted - drift) (k,).
        diagonal: (nv,) summed weights of the selecting tasks.
        pull: (nv,) their weighted wanted accelerations.
    """

    def __init__(self, robot: Robot, tasks: Sequence[Task]) -> None:
        """Check the tasks on `robot` and make room for them."""
        self.tasks = tuple(tasks)
        nv = robot.model.nv
        sizes = [task.check(robot) for task in self.tasks]
        self._selections = [task.selection(robot) for task in self.tasks]
        self._weights = [
            np.broadcast_to(np.asarray(task.weight, dtype=np.float64), (size,)).copy()
            for task, size in zip(self.tasks, sizes, strict=True)
        ]
        self._roots = [np.sqrt(weight) for weight in self._weights]
        self._columns = [root[:, None] for root in self._roots]
        self._slices: list[slice] = []
        total = 0
        for size, selection in zip(sizes, self._selections, strict=True):
            rows = 0 if selection is not None else size
            self._slices.append(slice(total, total + rows))
            total += rows
        self.matrix = np.zeros((total, nv))
        self.target = np.zeros(total)
        self.diagonal = np.zeros(nv)
        for selection, weight in zip(self._selections, self._weights, strict=True):
            if selection is not None:
                self.diagonal[selection] += weight
        self.pull = np.zeros(nv)
        self._last: dict[str, Reference] = {}

    def forget(self) -> None:
        """Forget the references held so far."""
        self._last.clear()

    def fill(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Evaluate every task at the present state.

        A task without a reference keeps its last one; one that never had any holds the value that
        it has now.
        """
        self.pull[:] = 0.0
        velocity = kinematics.velocity
        for i, task in enumerate(self.tasks):
            reference = self._reference(task, kinematics, references)
            selection = self._selections[i]
            weight = self._weights[i]
            if selection is not None:
                wanted = task.command(kinematics, reference, velocity[selection])
                self.pull[selection] += weight * wanted
                self._last[task.name] = reference
                continue
            rows, root = self._slices[i], self._roots[i]
            jacobian = task.jacobian(kinematics)
            wanted = task.command(kinematics, reference, jacobian @ velocity)
            wanted -= task.drift(kinematics)
            np.multiply(wanted, root, out=self.target[rows])
            np.multiply(jacobian, self._columns[i], out=self.matrix[rows])
            self._last[task.name] = reference

    @property
    def locks(self) -> int:
        """How many rows on qdd fix what all tasks of this stack obtain."""
        return len(self.matrix) + int(np.count_nonzero(self.diagonal))

    def lock(self, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rows (k, nv) and values (k,) that keep what `acceleration` gives the tasks."""
        chosen = np.flatnonzero(self.diagonal)
        rows = np.zeros((self.locks, len(acceleration)))
        rows[: len(self.matrix)] = self.matrix
        rows[np.arange(len(self.matrix), len(rows)), chosen] = 1.0
        return rows, rows @ acceleration

    def violation(self, acceleration: FloatArray) -> dict[str, float]:
        """Return how far each task is from what it wants, |J qdd - target| in its own units."""
        result = {}
        for i, task in enumerate(self.tasks):
            selection, weight = self._selections[i], self._weights[i]
            if selection is not None:
                gap = np.abs(weight * acceleration[selection] - self.pull[selection])
                scale = weight
            else:
                rows = self._slices[i]
                gap = np.abs(self.matrix[rows] @ acceleration - self.target[rows])
                scale = self._roots[i]
            values = np.divide(gap, scale, out=np.zeros_like(gap), where=scale > 0.0)
            result[task.name] = float(values.max(initial=0.0))
        return result

    def _reference(
        self, task: Task, kinematics: Kinematics, references: Mapping[str, Reference]
    ) -> Reference:
        reference = references.get(task.name)
        if reference is None:
            reference = self._last.get(task.name, _NOTHING)
        if reference.position is None:
            held = self._last.get(task.name)
            position = copy(task.value(kinematics)) if held is None else held.position
            reference = Reference(position, reference.velocity, reference.acceleration)
        return reference
