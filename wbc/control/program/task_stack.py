"""All tasks of one level, stacked into one weighted least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.program.stacking import place_rates, place_wanted
from wbc.control.reference import Reference
from wbc.control.tasks import Task
from wbc.robot import Robot

_NOTHING = Reference()


class _Entry(NamedTuple):
    """A task, whether it commands in its own way, and the memory of its rows.

    The memory is the Jacobian (None for a task that selects joints), its rate J v, and what the
    gains are applied to: error, drift, velocity and acceleration asked for.
    """

    task: Task
    own: bool
    jacobian: FloatArray | None
    rate: FloatArray
    error: FloatArray
    drift: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class TaskStack:
    """Weighted rows J qdd = wanted - drift, refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows. The gains of all tasks are applied
    at once.

    Attributes:
        jacobian: J (k, nv) of the tasks with rows.
        wanted: wanted - drift (k,).
        weight: w (k,) of the rows.
        chosen: (c,) coordinates of the selecting tasks, one for each of their rows.
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
        rowed = [i for i, chosen in enumerate(selections) if chosen is None]
        selecting = [i for i, chosen in enumerate(selections) if chosen is not None]
        total, whole = sum(sizes[i] for i in rowed), sum(sizes)
        self.jacobian, self._all_wanted = np.zeros((total, nv)), np.zeros(whole)
        self.wanted = self._all_wanted[:total]
        # error, rate, drift, velocity and acceleration asked for, and what each counts for
        self._parts, self._gains = np.zeros((5, whole)), np.zeros((5, whole))
        self._asked, self._rates = self._parts[3:], self._parts[1]
        self._entries: list[_Entry] = []
        start = 0
        for i in [*rowed, *selecting]:
            self._place(self.tasks[i], slice(start, start + sizes[i]), total)
            start += sizes[i]
        self._own = [entry for entry in self._entries if entry.own]
        self.weight = np.concatenate([weights[i] for i in rowed] or [np.zeros(0)])
        self.chosen = np.concatenate(
            [np.arange(nv)[selections[i]] for i in selecting] or [np.zeros(0, np.int_)]
        )
        self._chosen_weight = np.concatenate([weights[i] for i in selecting] or [np.zeros(0)])
        self.diagonal, self.pull = np.zeros(nv), np.zeros(nv)
        np.add.at(self.diagonal, self.chosen, self._chosen_weight)
        self._last: dict[str, Reference] = {}

    def _place(self, task: Task, rows: slice, total: int) -> None:
        """Give a task its rows and gains; one that commands in its own way has no gains here."""
        own = type(task).command is not Task.command
        self._gains[2, rows], self._gains[4, rows] = -1.0, 1.0
        if not own:
            gain = task.velocity_gain
            self._gains[0, rows], self._gains[1, rows] = task.stiffness, -gain
            self._gains[3, rows] = gain
        jacobian = self.jacobian[rows] if rows.start < total else None
        self._entries.append(_Entry(task, own, jacobian, *self._views(rows)))

    def _views(self, rows: slice) -> tuple[FloatArray, ...]:
        """Return the rates, errors, drifts, velocities and accelerations of some rows."""
        return tuple(self._parts[part, rows] for part in (1, 0, 2, 3, 4))

    def forget(self) -> None:
        """Forget the references held so far."""
        self._last.clear()

    def fill(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Evaluate every task at the present state.

        A task without a reference keeps its last one; one that never had any holds the value that
        it has now.
        """
        self._asked.fill(0.0)
        for entry in self._entries:
            self._evaluate(entry, kinematics, references)
        place_rates(self.jacobian, kinematics.velocity, self.chosen, self._rates)
        for entry in self._own:
            reference = self._last[entry.task.name]
            entry.acceleration[:] = entry.task.command(kinematics, reference, entry.rate)
        place_wanted(
            *(self._parts, self._gains, self.chosen, self._chosen_weight),
            *(self._all_wanted, self.pull),
        )

    def _evaluate(
        self, entry: _Entry, kinematics: Kinematics, references: Mapping[str, Reference]
    ) -> None:
        """Write the rows of one task."""
        task = entry.task
        reference = references.get(task.name) or self._last.get(task.name, _NOTHING)
        if reference.position is None:
            reference = self._held(task, kinematics, reference)
        if entry.jacobian is not None:
            entry.jacobian[:] = task.jacobian(kinematics)
            entry.drift[:] = task.drift(kinematics)
        if not entry.own:
            entry.error[:] = task.error(kinematics, reference.position)
            if reference.velocity is not None:
                entry.velocity[:] = reference.velocity
            if reference.acceleration is not None:
                entry.acceleration[:] = reference.acceleration
        self._last[task.name] = reference

    def _held(self, task: Task, kinematics: Kinematics, reference: Reference) -> Reference:
        """Return a reference with the position of the last one, or with the present value."""
        held = self._last.get(task.name)
        position = copy(task.value(kinematics)) if held is None else held.position
        return Reference(position, reference.velocity, reference.acceleration)
