"""All tasks of one level, stacked into one weighted least-squares problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.control.inputs import Reference, Target, TickInputError
from wbc.control.kinematics import Kinematics, rows_of
from wbc.control.memory import TASKS
from wbc.control.rows.tasks import PostureTask, StateTask, Task, vector_target
from wbc.errors import ControlError
from wbc.robot import Robot

_PARTS = "error", "rate", "drift", "velocity", "acceleration"


class _Entry(NamedTuple):
    """A task, and where its rows and its target stand.

    Attributes:
        task: the task.
        size: how many rows it has.
        rows: which ones of the stack.
        number: of its entry in ROWS, -1 for a task without.
        write: writes a target to where the tick reads it; None where the task says its rows itself
            in every tick.
    """

    task: Task
    size: int
    rows: slice
    number: int
    write: Callable[[Target], None] | None


class TaskStack:
    """Weighted rows J qdd = wanted - drift, refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows. Rows that follow from the state
    (`StateTask`) are evaluated all at once by the tick, other tasks are asked one by one before it.
    A task without weight is not evaluated.

    Targets stand where the tick reads them. The stack keeps those of the last tick that was
    remembered, by task: they come back where a tick was not.

    Attributes:
        memory: the TASKS.
    """

    def __init__(self, robot: Robot, tasks: Sequence[Task], model: pin.Model) -> None:
        """Check the tasks of a level on `robot`; `model` is that of the `Kinematics`."""
        selecting = [task for task in tasks if isinstance(task, PostureTask)]
        ordered = [*[task for task in tasks if task not in selecting], *selecting]
        ends = np.cumsum([0, *[task.check(robot) for task in ordered]]).tolist()
        placed = list(zip(ordered, (slice(a, b) for a, b in pairwise(ends)), strict=True))
        known = [(task, rows) for task, rows in placed if isinstance(task, StateTask)]
        total = ends[len(ordered) - len(selecting)]
        table = [task.state_rows for task, _ in known], [rows.start for _, rows in known]
        held = [(np.zeros(0, np.int_),) * 2, *[task.places(model) for task in selecting]]
        self.memory: Any = TASKS.of(
            {"k": ends[-1], "v": robot.model.nv, "c": ends[-1] - total, "e": len(known)},
            rows=rows_of(model, *table, total),
            positions=np.concatenate([positions for positions, _ in held]),
            chosen=np.concatenate([rows for _, rows in held]),
        )
        memory, gravity = self.memory, float(np.linalg.norm(robot.model.gravity.linear))
        places, self._entries = enumerate(memory.targets), dict[str, _Entry]()
        for task, rows in placed:
            memory.limits[rows], memory.gains[2, rows] = task.acceleration_limit, -1.0
            memory.gains[[0, 1, 3, 4], rows] = np.array(task.gains(gravity))[:, None]
            number, write, size = -1, None, rows.stop - rows.start
            if isinstance(task, StateTask):
                number, place = next(places)
                write = partial(task.pack, place=place)
                if type(task).pack is StateTask.pack:  # where it writes to is the same every time
                    write = partial(task.slot(place).__setitem__, slice(None))
            elif rows.start >= total:
                goals = memory.goals[rows.start - total : rows.stop - total]
                write = partial(goals.__setitem__, slice(None))
            self._entries[task.name] = _Entry(task, size, rows, number, write)
        self._shares: tuple[dict[str, float], dict[str, float]] | None = None
        self._moves, self._active = True, dict[str, _Entry]()
        self._missing, self._asked = list[_Entry](), list[_Entry]()
        self.forget()
        self.weigh(None, None)

    def weigh(
        self, weights: Mapping[str, float] | None, activation: Mapping[str, float] | None
    ) -> None:
        """Take the weights of a tick, and what they are multiplied with, as `Controller.step`."""
        if self._shares == (weights or {}, activation or {}):
            return
        self._shares = own, shares = dict(weights or {}), dict(activation or {})
        self._active, self._changed, memory = {}, True, self.memory
        for name, entry in self._entries.items():
            rows, share = entry.rows, shares.get(name, 1.0)
            weight = np.asarray(own.get(name, entry.task.weight))
            memory.weights[rows] = share * weight if share > 0.0 else 0.0
            active = bool(memory.weights[rows].any())
            if entry.number >= 0:
                memory.rows.used[entry.number] = active
            if active:
                self._active[name] = entry
            else:
                memory.parts[:, rows] = memory.rows.drift[rows] = 0.0
        self._asked = [entry for entry in self._active.values() if not entry.write]
        memory.diagonal[:] = 0.0
        np.add.at(memory.diagonal, memory.chosen, memory.weights[len(memory.rows.jacobian) :])

    def forget(self) -> None:
        """Forget the targets held so far."""
        self._held: dict[str, Target] = {}
        self._targets, self._changed = self._held, True

    def remember(self) -> None:
        """Hold the targets taken last from now on; tasks without weight hold nothing."""
        if self._changed:
            self._targets = {name: self._targets[name] for name in self._active}
            self._changed = False
        self._held = self._targets

    def take(self, references: Mapping[str, Reference]) -> bool:
        """Take references; return whether a task must be asked at the state.

        A task without a reference keeps its last target, at rest; one that never had any, or had
        no weight in the last tick, holds the value that it has now.

        Raises:
            TickInputError: a reference that does not fit its task; nothing is remembered then.
        """
        if self._targets is not self._held:
            self._targets = self._held
            for name, target in self._held.items():
                if write := self._entries[name].write:
                    write(target)
        if self._moves:
            self.memory.parts[3:] = 0.0
            self._moves = False
        for name, reference in references.items():
            entry = self._entries.get(name)
            if entry is not None:
                self._admit(entry, reference)
        unknown = self._active.keys() - self._targets.keys() if self._changed else ()
        self._missing = [self._active[name] for name in unknown]
        return bool(unknown or self._asked)

    def ask(self, kinematics: Kinematics) -> None:
        """Ask the tasks whose target or rows only they know; call where `take` returns True."""
        for entry in self._missing:
            self._put(entry, entry.task.admitted(entry.task.value(kinematics), entry.size))
        for entry in self._asked:
            task, rows, memory = entry.task, entry.rows, self.memory
            memory.rows.jacobian[rows] = task.jacobian(kinematics)
            memory.rows.drift[rows] = task.drift(kinematics)
            memory.parts[0, rows] = task.error(kinematics, self._targets[task.name])

    def _admit(self, entry: _Entry, reference: Reference) -> None:
        """Take the reference of one task; without weight it is only checked."""
        name = entry.task.name
        idle, ahead = name not in self._active, (reference.velocity, reference.acceleration)
        try:
            if reference.position is not None:
                target = entry.task.admitted(reference.position, entry.size)
                if not idle:
                    self._put(entry, target)
            for part, asked in enumerate(ahead, _PARTS.index("velocity")):
                if asked is not None:
                    values = vector_target(asked, entry.size, _PARTS[part])
                    if not idle:
                        self._moves, self.memory.parts[part, entry.rows] = True, values
        except ControlError as cause:
            raise TickInputError(f"the reference of task '{name}': {cause}.") from cause
        if idle and not reference.is_finite():
            raise TickInputError(f"the reference of task '{name}' is not finite.")

    def _put(self, entry: _Entry, target: Target) -> None:
        """Take a target for this tick."""
        if self._targets is self._held:
            self._targets = dict(self._held)
        self._targets[entry.task.name] = target
        if entry.write:
            entry.write(target)
