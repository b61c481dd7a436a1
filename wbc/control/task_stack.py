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
    """A task with rows, whether it commands in its own way, and the memory of its rows.

    The memory is the Jacobian, its rate J v, and what the gains are applied to: error, drift,
    velocity and acceleration asked for.
    """

    task: Task
    own: bool
    jacobian: FloatArray
    rate: FloatArray
    error: FloatArray
    drift: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class _Chosen(NamedTuple):
    """A task that selects joints."""

    task: Task
    rows: Rows
    weight: FloatArray


class TaskStack:
    """Weighted rows J qdd = wanted - drift, refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows. The gains of all tasks with rows
    are applied to the whole stack at once.

    Attributes:
        jacobian: J (k, nv) of the tasks with rows.
        wanted: wanted - drift (k,).
        softness: 1/w (k,) of the rows, infinite for rows without weight.
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
        self.jacobian, self.wanted = np.zeros((total, nv)), np.zeros(total)
        self._weight = np.zeros(total)
        self.diagonal, self.pull = np.zeros(nv), np.zeros(nv)
        # error, rate, drift, velocity and acceleration asked for, and what each counts for
        self._parts, self._gains = np.zeros((5, total)), np.zeros((5, total))
        self._products = np.zeros((5, total))
        self._asked, self._ones = self._parts[3:], np.ones(5)
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
        with np.errstate(divide="ignore"):
            self.softness = 1.0 / self._weight
        self._last: dict[str, Reference] = {}

    def _place(self, task: Task, rows: slice, weight: FloatArray) -> _Rowed:
        """Give a task its rows and gains; one that commands in its own way has no gains here."""
        own = type(task).command is not Task.command
        self._weight[rows] = weight
        self._gains[2, rows], self._gains[4, rows] = -1.0, 1.0
        if not own:
            gain = task.velocity_gain
            self._gains[0, rows], self._gains[1, rows] = task.stiffness, -gain
            self._gains[3, rows] = gain
        error, rate, drift, velocity, acceleration = (part[rows] for part in self._parts)
        return _Rowed(task, own, self.jacobian[rows], rate, error, drift, velocity, acceleration)

    def forget(self) -> None:
        """Forget the references held so far."""
        self._last.clear()

    def fill(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Evaluate every task at the present state.

        A task without a reference keeps its last one; one that never had any holds the value that
        it has now.
        """
        self._asked.fill(0.0)
        for entry in self._rowed:
            self._evaluate(entry, kinematics, references)
        self.jacobian.dot(kinematics.velocity, out=self._parts[1])
        for entry in self._rowed:
            if entry.own:
                reference = self._last[entry.task.name]
                entry.acceleration[:] = entry.task.command(kinematics, reference, entry.rate)
        np.multiply(self._gains, self._parts, out=self._products)
        self._ones.dot(self._products, out=self.wanted)
        self._pull(kinematics, references)

    def _evaluate(
        self, entry: _Rowed, kinematics: Kinematics, references: Mapping[str, Reference]
    ) -> None:
        """Write the rows of one task."""
        task = entry.task
        reference = self._reference(task, kinematics, references)
        entry.jacobian[:] = task.jacobian(kinematics)
        entry.drift[:] = task.drift(kinematics)
        if not entry.own:
            entry.error[:] = task.error(kinematics, reference.position)
            if reference.velocity is not None:
                entry.velocity[:] = reference.velocity
            if reference.acceleration is not None:
                entry.acceleration[:] = reference.acceleration
        self._last[task.name] = reference

    def _pull(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        pull, velocity = self.pull, kinematics.velocity
        if len(self._chosen) > 1:
            pull.fill(0.0)
        for task, chosen, weight in self._chosen:
            reference = self._reference(task, kinematics, references)
            wanted = task.command(kinematics, reference, velocity[chosen])
            wanted *= weight
            if len(self._chosen) > 1:
                wanted += pull[chosen]
            pull[chosen] = wanted
            self._last[task.name] = reference

    def cost(self) -> tuple[FloatArray, FloatArray]:
        """Return Hessian (nv, nv) and gradient (nv,) of the cost of all tasks on qdd."""
        weighted = self._weight[:, None] * self.jacobian
        hessian = weighted.T @ self.jacobian
        hessian.reshape(-1)[:: len(hessian) + 1] += self.diagonal
        return hessian, -(self.wanted @ weighted) - self.pull

    @property
    def locks(self) -> int:
        """How many rows on qdd fix what all tasks of this stack obtain."""
        return len(self.wanted) + int(np.count_nonzero(self.diagonal))

    def lock(self, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rows (k, nv) and values (k,) that keep what `acceleration` gives the tasks."""
        chosen = np.flatnonzero(self.diagonal)
        rows = np.zeros((self.locks, len(acceleration)))
        rows[: len(self.wanted)] = np.sqrt(self._weight)[:, None] * self.jacobian
        rows[np.arange(len(self.wanted), len(rows)), chosen] = 1.0
        return rows, rows @ acceleration

    def _reference(
        self, task: Task, kinematics: Kinematics, references: Mapping[str, Reference]
    ) -> Reference:
        reference = references.get(task.name) or self._last.get(task.name, _NOTHING)
        if reference.position is None:
            held = self._last.get(task.name)
            position = copy(task.value(kinematics)) if held is None else held.position
            reference = Reference(position, reference.velocity, reference.acceleration)
        return reference
