"""All tasks of one level, stacked into one weighted least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, reals
from wbc.control.kinematics import FrameTable, Kinematics, StateRows
from wbc.control.program.stacking import STACK, place_rates, want
from wbc.control.reference import Reference, Target
from wbc.control.tasks import Task
from wbc.errors import ControlError
from wbc.fixed_arrays import FixedArrays
from wbc.robot import Robot

_NONE: Mapping[str, float] = {}
_REST = Reference()
_FLOAT = np.dtype(np.float64)


class _Entry(NamedTuple):
    """A task, how it is evaluated, and the memory of its rows.

    Attributes:
        task, name, size: the task, its name, and how many rows it has.
        own: whether it commands in its own way.
        number: place of its target in the table of frames, -1 for a task that is asked itself.
        place: memory of its target in that table (12,), None where it has none.
        goals: its part of the joints' targets (k,), None unless it is of joints.
        weights: of its rows (k,).
        jacobian: memory of J (k, nv), None for a task that selects joints.
        rate, error, drift, velocity, acceleration: J v, what the gains are applied to, (k,).
    """

    task: Task
    name: str
    size: int
    own: bool
    number: int
    place: FloatArray | None
    goals: FloatArray | None
    weights: FloatArray
    jacobian: FloatArray | None
    rate: FloatArray
    error: FloatArray
    drift: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class TaskStack:
    """Weighted rows J qdd = wanted - drift, refilled in place every tick.

    Tasks that select joints go to a diagonal instead of rows. Rows that follow from the state
    (`Task.state_rows`, `Task.positions`) are evaluated all at once, other tasks are asked one by
    one. The gains of all tasks are applied at once. A task without weight is not evaluated.

    Attributes:
        jacobian: J (k, nv) of the tasks with rows.
        wanted: wanted - drift (k,).
        weight: w (k,) of the rows.
        rows_off: how many of the rows have no weight.
        chosen: (c,) coordinates of the selecting tasks, one for each of their rows.
        diagonal: (nv,) summed weights of the selecting tasks.
        pull: (nv,) their weighted wanted accelerations.
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
        sizes = [task.check(robot) for task in self.tasks]
        selections = [
            None if np.isinf(task.weight).any() else task.selection(robot) for task in self.tasks
        ]
        rowed = [i for i, chosen in enumerate(selections) if chosen is None]
        selecting = [i for i, chosen in enumerate(selections) if chosen is not None]
        total, whole = sum(sizes[i] for i in rowed), sum(sizes)
        self.jacobian, self._all_wanted = np.zeros((total, nv)), np.zeros(whole)
        self.wanted = self._all_wanted[:total]
        # error, rate, drift, velocity and acceleration asked for, and what each counts for
        self._parts, self._gains = np.zeros((5, whole)), np.zeros((5, whole))
        self._asked, self._rates, self._drift = self._parts[3:], self._parts[1], self._parts[2]
        self._weights = np.zeros(whole)
        self.weight, self._chosen_weight = self._weights[:total], self._weights[total:]
        self._goals = np.zeros(whole - total)
        self._positions = np.full(whole - total, -1)
        self._entries: list[_Entry] = []
        self._targets = np.zeros((len(self.tasks), 12))  # one for every row of the table, or more
        table: list[tuple[StateRows, int]] = []
        start = 0
        for i in [*rowed, *selecting]:
            self._place(self.tasks[i], slice(start, start + sizes[i]), table, model)
            start += sizes[i]
        self._table = FrameTable(model, [rows for rows, _ in table], [first for _, first in table])
        self._packed: dict[str, Target] = {}
        self.chosen = np.concatenate(
            [np.arange(nv)[selections[i]] for i in selecting] or [np.zeros(0, np.int_)]
        )
        self.diagonal, self.pull = np.zeros(nv), np.zeros(nv)
        table_memory = self._table.plan, self._table.used, self._table.places, self._targets
        self._fixed = FixedArrays(
            STACK,
            (
                *(*table_memory, self.jacobian, self.chosen, self._positions, self._goals),
                *(self._parts, self._gains, self._chosen_weight, self._all_wanted, self.pull),
            ),
        )
        self._memory = self._fixed.table
        self._held: dict[str, Target] = {}
        self._pending: dict[str, Target] = {}
        self._by_name = {entry.name: entry for entry in self._entries}
        # whether to look what is known, whether something is not, and what is asked beyond rest
        self._stale = self._unknown = self._asks = True
        self._drops = True  # whether tasks without weight may hold a target
        self._shares: tuple[dict[str, float], dict[str, float]] | None = None
        self.weigh(None, None)

    def _place(
        self, task: Task, rows: slice, table: list[tuple[StateRows, int]], model: pin.Model
    ) -> None:
        """Give a task its rows and gains; one that commands in its own way has no gains here."""
        own = type(task).command is not Task.command
        self._gains[2, rows], self._gains[4, rows] = -1.0, 1.0
        if not own:
            gain = task.velocity_gain
            self._gains[0, rows], self._gains[1, rows] = task.stiffness, -gain
            self._gains[3, rows] = gain
        size, total = rows.stop - rows.start, len(self.wanted)
        weights = np.broadcast_to(np.asarray(task.weight, dtype=np.float64), (size,)).copy()
        jacobian, number, place, goals = None, -1, None, None
        if rows.start < total:
            jacobian, known = self.jacobian[rows], task.state_rows
            if known is not None:
                number = len(table)
                place = self._targets[number]
                table.append((known, rows.start))
        elif task.positions is not None:
            chosen = slice(rows.start - total, rows.stop - total)
            goals = self._goals[chosen]
            self._positions[chosen] = np.arange(model.nq)[task.positions]
        views = (self._parts[part, rows] for part in (1, 0, 2, 3, 4))
        self._entries.append(
            _Entry(task, task.name, size, own, number, place, goals, weights, jacobian, *views)
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
                self._table.used[entry.number] = active
            if active:
                self._active.append(entry)
            else:
                self._idle.append(entry)
                self._parts[:, rows] = 0.0
        self._off = frozenset(entry.name for entry in self._idle)
        self._stale = self._drops = True
        self._own = [entry for entry in self._active if entry.own]
        self.rows_off = len(self.weight) - int(np.count_nonzero(self.weight > 0.0))
        self.diagonal[:] = 0.0
        np.add.at(self.diagonal, self.chosen, self._chosen_weight)

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
        # what was pending is packed as well; only where some were not, look again
        self._stale = self._unknown

    def is_known(self) -> bool:
        """Return whether all targets are held, and rows follow from them and the state alone."""
        if self._stale:
            held, packed = self._held, self._packed
            self._unknown = bool(self._own) or not all(
                entry.name in held and packed.get(entry.name) is held[entry.name]
                for entry in self._active
            )
            self._stale = self._unknown
        return not self._unknown

    def take(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Take references where all targets are known; they read nothing of the kinematics.

        Raises:
            ControlError: a reference that does not fit its task; nothing is remembered then.
        """
        if self._asks:
            self._asked.fill(0.0)
            self._asks = False
        self._pending.clear()
        for name, reference in references.items():
            entry = self._by_name.get(name)
            if entry is None:
                continue
            if entry.name in self._off:
                self._check_idle(entry, reference)
            else:
                self._evaluate(entry, kinematics, reference)

    def memory(self, kinematics: Kinematics) -> tuple[IntArray, IntArray]:
        """Return the memory of `fill_state_rows` and `want`, which `fill` calls."""
        return self._table.memory(kinematics, self.jacobian, self._drift), self._memory

    def fill(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Evaluate every task at the present state.

        A task without a reference keeps its last target, at rest; one that never had any, or had
        no weight in the last tick, holds the value that it has now.

        Raises:
            ControlError: a reference that does not fit its task; nothing is remembered then.
        """
        self._asked.fill(0.0)
        self._asks = False
        self._pending.clear()
        held, packed = self._held, self._packed
        for entry in self._active:
            name = entry.name
            reference = references.get(name, _REST)
            target = held.get(name)
            if reference is not _REST or target is None or packed.get(name) is not target:
                self._evaluate(entry, kinematics, reference)
        for entry in self._idle:
            reference = references.get(entry.name, _REST)
            if reference is not _REST:
                self._check_idle(entry, reference)
        self._table.fill(kinematics, self.jacobian, self._drift)
        if self._own:
            self._ask_own(kinematics, references)
        want(self._memory, kinematics.position, kinematics.velocity)

    def _ask_own(self, kinematics: Kinematics, references: Mapping[str, Reference]) -> None:
        """Take the accelerations of the tasks that command in their own way."""
        place_rates(self.jacobian, kinematics.velocity, self.chosen, self._rates)
        for entry in self._own:
            reference = references.get(entry.name, _REST)
            target = self._pending.get(entry.name, self._held.get(entry.name))
            held = Reference(target, reference.velocity, reference.acceleration)
            entry.acceleration[:] = entry.task.command(kinematics, held, entry.rate)

    def _evaluate(self, entry: _Entry, kinematics: Kinematics, reference: Reference) -> None:
        """Take the reference of one task, and write its rows where it says itself where it is."""
        task = entry.task
        target = self._target(entry, kinematics, reference)
        self._pending[entry.name] = target
        self._stale = True
        velocity, acceleration = reference.velocity, reference.acceleration
        if velocity is not None or acceleration is not None:
            self._asks = True
        if velocity is not None:
            entry.velocity[:] = rates(velocity, "velocity", entry.size, task.name)
        if acceleration is not None:
            entry.acceleration[:] = rates(acceleration, "acceleration", entry.size, task.name)
        if entry.goals is not None:
            entry.goals[:] = target
        elif entry.place is not None:
            task.pack(target, entry.place)
        else:
            if entry.jacobian is not None:
                entry.jacobian[:] = task.jacobian(kinematics)
                entry.drift[:] = task.drift(kinematics)
            if not entry.own:
                entry.error[:] = task.error(kinematics, target)
            return
        self._packed[entry.name] = target

    def _target(self, entry: _Entry, kinematics: Kinematics, reference: Reference) -> Target:
        """Return the target of a reference, else the one held, else the present value."""
        task = entry.task
        if reference.position is None:
            if task.name in self._held:
                return self._held[task.name]
            return task.admitted(task.value(kinematics), entry.size)
        try:
            return task.admitted(reference.position, entry.size)
        except ControlError as cause:
            raise ControlError(f"the reference of task '{task.name}': {cause}.") from cause

    @staticmethod
    def _check_idle(entry: _Entry, reference: Reference) -> None:
        """Raise ControlError for a reference that would not fit if the task had a weight."""
        name = entry.task.name
        if reference.position is not None:
            try:
                entry.task.admitted(reference.position, entry.size)
            except ControlError as cause:
                raise ControlError(f"the reference of task '{name}': {cause}.") from cause
        for label in ("velocity", "acceleration"):
            asked = getattr(reference, label)
            if asked is not None:
                rates(asked, label, entry.size, name)
        if not reference.is_finite():
            raise ControlError(f"the reference of task '{name}' is not finite.")


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
