"""All tasks of one level, stacked into one weighted least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Reference
from wbc.control.selection import Rows
from wbc.control.tasks import Task
from wbc.robot import Robot

_NOTHING = Reference()


class _Rowed(NamedTuple):
    """A task with rows: where they are, and whether it commands in its own way."""

    task: Task
    own: bool
    rows: slice
    jacobian: FloatArray
    rate: FloatArray
    error: FloatArray
    drift: FloatArray
    gain: float


class _Chosen(NamedTuple):
    """A task that selects joints."""

    task: Task
    rows: Rows
    weight: FloatArray


class TaskStack:
    """Weighted rows W J qdd = W (wanted - drift), refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows. The gains of all tasks with rows
    are applied to the whole stack at once.

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
        selections = [task.selection(robot) for task in self.tasks]
        weights = [
            np.broadcast_to(np.asarray(task.weight, dtype=np.float64), (size,)).copy()
            for task, size in zip(self.tasks, sizes, strict=True)
        ]
        total = sum(size for size, chosen in zip(sizes, selections, strict=True) if chosen is None)
        self.matrix, self.target = np.zeros((total, nv)), np.zeros(total)
        self.diagonal, self.pull = np.zeros(nv), np.zeros(nv)
        self._jacobian = np.zeros((total, nv))
        self._rate, self._error, self._drift = np.zeros(total), np.zeros(total), np.zeros(total)
        self._root = np.zeros(total)
        self._stiffness, self._damping = np.zeros(total), np.zeros(total)
        self._rowed: list[_Rowed] = []
        self._chosen: list[_Chosen] = []
        start = 0
        for task, size, chosen, weight in zip(self.tasks, sizes, selections, weights, strict=True):
            if chosen is not None:
                self._chosen.append(_Chosen(task, chosen, weight))
                self.diagonal[chosen] += weight
                continue
            rows = slice(start, start + size)
            self._rowed.append(self._place(task, rows, weight))
            start += size
        self._column = self._root[:, None]
        self._last: dict[str, Reference] = {}

    def _place(self, task: Task, rows: slice, weight: FloatArray) -> _Rowed:
        """Give a task its rows and gains; one that commands in its own way has no gains here."""
        own = type(task).command is not Task.command
        self._root[rows] = np.sqrt(weight)
        if not own:
            self._stiffness[rows], self._damping[rows] = task.stiffness, task.velocity_gain
        return _Rowed(
            task,
            own,
            rows,
            self._jacobian[rows],
            self._rate[rows],
            self._error[rows],
            self._drift[rows],
            task.velocity_gain,
        )

    def forget(self) -> None:
        """Forget the references held so far."""
        self._last.clear()

    def fill(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Evaluate every task at the present state.

        A task without a reference keeps its last one; one that never had any holds the value that
        it has now.
        """
        drift, target = self._drift, self.target
        fed = [self._evaluate(entry, kinematics, references) for entry in self._rowed]
        self._jacobian.dot(kinematics.velocity, out=self._rate)
        np.multiply(self._stiffness, self._error, out=target)
        target -= drift
        np.multiply(self._damping, self._rate, out=drift)
        target -= drift
        for entry, reference in zip(self._rowed, fed, strict=True):
            if entry.own:
                target[entry.rows] += entry.task.command(kinematics, reference, entry.rate)
            else:
                if reference.velocity is not None:
                    target[entry.rows] += entry.gain * reference.velocity
                if reference.acceleration is not None:
                    target[entry.rows] += reference.acceleration
        target *= self._root
        np.multiply(self._jacobian, self._column, out=self.matrix)
        self._pull(kinematics, references)

    def _evaluate(
        self, entry: _Rowed, kinematics: Kinematics, references: Mapping[str, Reference]
    ) -> Reference:
        """Write the rows of one task; return its reference."""
        task = entry.task
        reference = self._reference(task, kinematics, references)
        entry.jacobian[:] = task.jacobian(kinematics)
        entry.drift[:] = task.drift(kinematics)
        if not entry.own:
            entry.error[:] = task.error(kinematics, reference.position)
        self._last[task.name] = reference
        return reference

    def _pull(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        pull, velocity = self.pull, kinematics.velocity
        pull.fill(0.0)
        for task, chosen, weight in self._chosen:
            reference = self._reference(task, kinematics, references)
            wanted = task.command(kinematics, reference, velocity[chosen])
            wanted *= weight
            pull[chosen] += wanted
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
