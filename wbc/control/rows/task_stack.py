"""All tasks of one level, stacked into one weighted least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, reals
from wbc.control.kinematics import FrameTable, Kinematics, StateRows
from wbc.control.reference import Reference, Target
from wbc.control.rows.posture import PostureTask
from wbc.control.rows.task import StateTask, Task
from wbc.control.tick import TASKS
from wbc.errors import ControlError
from wbc.robot import Robot

_NONE: Mapping[str, float] = {}
_FLOAT = np.dtype(np.float64)


class _Entry(NamedTuple):
    """A task, how it is evaluated, and the memory of its rows.

    Attributes:
        task, name, size: the task, its name, and how many rows it has.
        asked: whether it says its rows itself in every tick.
        number: place of its target in the table of frames, -1 for a task without.
        place: memory of its target in that table (12,), None where it has none.
        goals: its part of the joints' targets (k,), None unless it is of joints.
        weights: of its rows (k,).
        jacobian, drift: memory of J (k, nv) and dJ/dt v (k,), None for a task that selects joints.
        error, velocity, acceleration: what the gains are applied to, (k,).
    """

    task: Task
    name: str
    size: int
    asked: bool
    number: int
    place: FloatArray | None
    goals: FloatArray | None
    weights: FloatArray
    jacobian: FloatArray | None
    drift: FloatArray | None
    error: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class TaskStack:
    """Weighted rows J qdd = wanted - drift, refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows. Rows that follow from the state
    (`StateTask`) are evaluated all at once by the tick, other tasks are
    asked one by one before it. A task without weight is not evaluated.

    Attributes:
        tasks: of one level.
        memory: the TASKS.
        names: of the task of every row.
    """

    def __init__(self, robot: Robot, tasks: Sequence[Task], model: pin.Model) -> None:
        """Check the tasks on `robot` and make room for them.

        Args:
            robot: the robot.
            tasks: of one level.
            model: of the `Kinematics` that is read.
        """
        self.tasks = tuple(tasks)
        nv = robot.model.nv
        sizes = {task.name: task.check(robot) for task in self.tasks}
        selecting = [
            task
            for task in self.tasks
            if isinstance(task, PostureTask) and not np.isinf(task.weight).any()
        ]
        rowed = [task for task in self.tasks if task not in selecting]
        total = sum(sizes[task.name] for task in rowed)
        whole = sum(sizes.values())
        self._jacobian, self._drift = np.zeros((total, nv)), np.zeros(total)
        # error, rate, drift, velocity and acceleration asked for, and what each counts for
        self._parts, self._gains, self._weights = (
            np.zeros((5, whole)),
            np.zeros((5, whole)),
            np.zeros(whole),
        )
        limits = np.full(whole, np.inf)
        self._targets = np.zeros((len(self.tasks), 12))  # one for every row of the table, or more
        goals = np.zeros(whole - total)
        gravity = float(np.linalg.norm(robot.model.gravity.linear))
        self._entries: list[_Entry] = []
        table: list[StateRows] = []
        firsts: list[int] = []
        start = 0
        for task in [*rowed, *selecting]:
            rows = slice(start, start + sizes[task.name])
            start = rows.stop
            limits[rows] = task.acceleration_limit
            gains = task.gains(gravity)
            self._gains[0, rows], self._gains[1, rows] = gains[:2]
            self._gains[2, rows], self._gains[3, rows], self._gains[4, rows] = -1.0, *gains[2:]
            known = task.state_rows if isinstance(task, StateTask) else None
            if known is not None:
                table.append(known)
                firsts.append(rows.start)
            goal = goals[rows.start - total : rows.stop - total] if rows.start >= total else None
            self._entries.append(self._entry(task, rows, known is not None, goal, len(table) - 1))
        frames = FrameTable(model, table, firsts, self._jacobian, self._drift)
        none = np.zeros(0, np.int_)
        self.memory: Any = TASKS.of(
            rows=frames.rows,
            targets=self._targets,
            chosen=np.concatenate([none, *[task.velocities for task in selecting]]),
            positions=np.concatenate([none, *[task.positions for task in selecting]]),
            goals=goals,
            gains=self._gains,
            limits=limits,
            weights=self._weights,
            parts=self._parts,
            wanted=np.zeros(whole),
            diagonal=np.zeros(nv),
            pull=np.zeros(nv),
        )
        self._packed: dict[str, Target] = {}
        self._held: dict[str, Target] = {}
        self._pending: dict[str, Target] = {}
        self.names = [entry.name for entry in self._entries for _ in range(entry.size)]
        self._by_name = {entry.name: entry for entry in self._entries}
        self._missing: list[_Entry] = []
        self._stale = self._moves = self._drops = True
        self._shares: tuple[dict[str, float], dict[str, float]] | None = None
        self.weigh(None, None)

    def _entry(
        self, task: Task, rows: slice, known: bool, goals: FloatArray | None, number: int
    ) -> _Entry:
        """Return a task with views of the memory of its rows."""
        has_rows = rows.start < len(self._jacobian)
        size, parts = rows.stop - rows.start, self._parts
        weights = np.broadcast_to(np.asarray(task.weight, dtype=np.float64), (size,)).copy()
        jacobian, drift = (self._jacobian[rows], self._drift[rows]) if has_rows else (None, None)
        return _Entry(
            task=task,
            name=task.name,
            size=size,
            asked=not known and goals is None,
            number=number if known else -1,
            place=self._targets[number] if known else None,
            goals=goals,
            weights=weights,
            jacobian=jacobian,
            drift=drift,
            error=parts[0, rows],
            velocity=parts[3, rows],
            acceleration=parts[4, rows],
        )

    def weigh(
        self, weights: Mapping[str, float] | None, activation: Mapping[str, float] | None
    ) -> None:
        """Take the weights of a tick.

        Args:
            weights: by task, in place of the task's own.
            activation: by task, 0 to 1, what the weight is multiplied with; 1 where left out.
        """
        if self._shares == (weights or _NONE, activation or _NONE):
            return
        self._shares = dict(weights or _NONE), dict(activation or _NONE)
        start, self._active, self._idle = 0, [], []
        for entry in self._entries:
            rows = slice(start, start + entry.size)
            start = rows.stop
            own = self._shares[0].get(entry.name, entry.weights)
            share = self._shares[1].get(entry.name, 1.0)
            self._weights[rows] = share * own if share > 0.0 else 0.0
            active = bool(self._weights[rows].any())
            if entry.number >= 0:
                self.memory.rows.used[entry.number] = active
            if active:
                self._active.append(entry)
            else:
                self._idle.append(entry)
                self._parts[:, rows] = 0.0
                if entry.drift is not None:
                    entry.drift[:] = 0.0
        self._off = frozenset(entry.name for entry in self._idle)
        self._stale = self._drops = True
        self._asked = [entry for entry in self._active if entry.asked]
        memory = self.memory
        memory.diagonal[:] = 0.0
        np.add.at(memory.diagonal, memory.chosen, self._weights[len(self._jacobian) :])

    def forget(self) -> None:
        """Forget the targets held so far."""
        self._held.clear()
        self._stale = True

    def remember(self) -> None:
        """Hold the targets taken last from now on; tasks without weight hold nothing."""
        if self._pending:
            self._held.update(self._pending)
        if self._drops:
            for entry in self._idle:
                self._held.pop(entry.name, None)
            self._drops = False
        self._stale = bool(self._missing)

    def take(self, references: Mapping[str, Reference]) -> bool:
        """Take references; return whether a task must be asked at the state.

        A task without a reference keeps its last target, at rest; one that never had any, or had
        no weight in the last tick, holds the value that it has now.

        Raises:
            ControlError: a reference that does not fit its task; nothing is remembered then.
        """
        if self._moves:
            self._parts[3:] = 0.0
            self._moves = False
        self._pending.clear()
        for name, reference in references.items():
            entry = self._by_name.get(name)
            if entry is not None:
                self._admit(entry, reference)
        if self._stale:
            held, packed, pending = self._held, self._packed, self._pending
            self._missing = [
                entry
                for entry in self._active
                if entry.name not in pending
                and (entry.name not in held or packed.get(entry.name) is not held[entry.name])
            ]
            self._stale = bool(self._pending)
        return bool(self._missing or self._asked)

    def ask(self, kinematics: Kinematics) -> None:
        """Ask the tasks whose target or rows only they know; call where `take` returns True."""
        for entry in self._missing:
            target = self._held.get(entry.name)
            if target is None:
                target = entry.task.admitted(entry.task.value(kinematics), entry.size)
            self._pack(entry, target)
        for entry in self._asked:
            target = self._pending.get(entry.name, self._held.get(entry.name))
            task = entry.task
            if entry.jacobian is not None and entry.drift is not None:
                entry.jacobian[:] = task.jacobian(kinematics)
                entry.drift[:] = task.drift(kinematics)
            entry.error[:] = task.error(kinematics, target)

    def _admit(self, entry: _Entry, reference: Reference) -> None:
        """Take the reference of one task; without weight it is only checked."""
        position, idle = reference.position, entry.name in self._off
        if position is not None:
            try:
                target = entry.task.admitted(position, entry.size)
            except ControlError as cause:
                raise ControlError(f"the reference of task '{entry.name}': {cause}.") from cause
            if not idle:
                self._pack(entry, target)
        for label, part in (("velocity", entry.velocity), ("acceleration", entry.acceleration)):
            asked = getattr(reference, label)
            if asked is not None:
                checked = rates(asked, label, entry.size, entry.name)
                if not idle:
                    part[:], self._moves = checked, True
        if idle and not reference.is_finite():
            raise ControlError(f"the reference of task '{entry.name}' is not finite.")

    def _pack(self, entry: _Entry, target: Target) -> None:
        """Write a target to where the tick reads it."""
        if entry.goals is not None:
            entry.goals[:] = target
        elif entry.place is not None:
            cast(StateTask, entry.task).pack(target, entry.place)
        self._pending[entry.name] = self._packed[entry.name] = target
        self._stale = True


def rates(asked: FloatArray, label: str, size: int, task: str) -> FloatArray:
    """Return a reference's velocity or acceleration (size,) as floats.

    Raises:
        ControlError: another shape, or no real numbers.
    """
    if type(asked) is not np.ndarray or asked.dtype is not _FLOAT:
        try:
            asked = reals(asked)
        except (TypeError, ValueError) as cause:
            raise ControlError(f"the reference of task '{task}': {label}: {cause}.") from cause
    if asked.shape != (size,):
        raise ControlError(
            f"the reference of task '{task}': {label} has shape {asked.shape}, expected ({size},)."
        )
    return asked
