"""A tick from top to bottom: a state and wishes go in at `step`, rotor torques come out.

1. `step` checks what it is given and takes what effects make of it (`_inputs`, `drivetrain`).
2. `_ask` has pinocchio evaluate M and J, and asks tasks and solids what only Python can say.
3. `_solve` takes the levels of priority one after the other. `write` writes the program of one, a
   function of `wbc.control.rows` for every kind of row, and `level.hold` what is decided above.
4. `guess` solves it from the bounds that bound the last solution, without torque limits, and
   `place_torques` takes the solution through the gears. That is the end of a usual tick.
5. Where a guess finds no solution, or a torque beyond its limit, `level.search` looks for the
   directions of power, with the mesh law in the rows of `place_torque_limits`. What it cannot guess
   either is left to daqp by `Level._in_turn`, where limits of joints and distances give way that
   cannot all be kept.
6. `_accepted` remembers what the next tick starts from; without a solution `Fallback` commands.

Rows that no state changes, friction cones and normal forces, stand in a `Program` since it was laid
out; its `take` writes ceilings of forces, and distances of solids.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from threading import Lock
from time import perf_counter
from typing import NoReturn, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Row, Vector, compiled, make_ready, view
from wbc.control.command import Command, Status
from wbc.control.fallback import Fallback
from wbc.control.inputs import InputCheck, Reference, State, complaint_of, size_complaint
from wbc.control.kinematics import move_joints
from wbc.control.memory import COUNT, GEAR, NUMBER, PART, ProgramMemory
from wbc.control.qp.level import Level, LevelAnswer, Levels
from wbc.control.qp.program import Recipe
from wbc.control.qp.search import DONE, LIMITED_TORQUE, UNSOLVED, guess
from wbc.control.qp.solvers import QPProblem
from wbc.control.rows.collision import CollisionLimit
from wbc.control.rows.contacts import Contact
from wbc.control.rows.gear_rows import place_loads, place_map, place_torques
from wbc.control.rows.limits import Effort, JointLimit, RotorTorqueLimit
from wbc.control.rows.motion_rows import (
    place_balance,
    place_joint_bounds,
    place_tasks,
    rest_contacts,
    want,
)
from wbc.control.rows.tasks import Task
from wbc.control.settings import ControllerSettings
from wbc.mechanics.linear import copy_to
from wbc.robot import Motion, Robot


@final
class Controller:
    """Whole-body controller of a robot with lossy gears.

    Each tick solves the contact-force program (accelerations and contact forces under the
    dissipative equation of motion, see `Program`) and realises its output torques
    through the gears, in the direction of power that the solution itself has. The user owns the
    loop; `step` never raises. One thread at a time may be in `step`; a second one gets the last
    good torque and is told so.

    Attributes:
        robot: the robot, with the effects to compensate.
        tasks: what it should do.
        settings: everything else.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task | Effort],
        contacts: Sequence[Contact] = (),
        limits: Sequence[RotorTorqueLimit | JointLimit | CollisionLimit] | None = None,
        settings: ControllerSettings | None = None,
    ) -> None:
        """Set the controller up.

        Args:
            robot: the robot model to obey; `robot.lossless()` makes a conservative controller.
            tasks: tasks and efforts with different names; at least one moves the robot at
                level 0.
            contacts: contacts that may be active; all are, unless `step` says otherwise.
            limits: at most one of each kind; left out, the rotor torque limits hold and the
                limits of joints that the model states. `[RotorTorqueLimit()]` leaves these out.
            settings: the defaults when left out.

        Raises:
            ControlError: no tasks, two of one name, or one that does not fit the robot.
            RobotError: a contact, joint or frame that the robot does not have, or a model file
                that closes a loop.
        """
        robot.require_tree()
        make_ready("wbc.control")
        self.robot, self.tasks = robot, tuple(tasks)
        self.settings = ControllerSettings() if settings is None else settings
        limits = (RotorTorqueLimit(), JointLimit()) if limits is None else limits
        self._parts = parts = Recipe(robot, self.tasks, contacts, limits, self.settings)
        names = frozenset(task.name for task in self.tasks)
        weighed = frozenset(task.name for task in self.tasks if isinstance(task, Task))
        self._inputs = InputCheck(robot, names, weighed, tuple(parts.contacts))
        self._levels = Levels(parts)  # of priority, for every set of contacts
        self._fallback = Fallback(parts, self._levels.whole)
        self._free = Lock()  # held by the thread that is in `step`
        self._answer: LevelAnswer | None = None  # of the last tick that asked a level
        self.reset()

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        for stack in self._parts.stacks:
            stack.forget()
        # block of results of the last tick with a solution, see `PART`
        self._last: FloatArray = np.zeros(self._levels.shared)
        self._parts.joints.load[:] = np.nan
        self._parts.drivetrain.forget()
        self._fallback.remember(None)
        self._levels.forget()

    def step(
        self,
        state: State,
        references: Mapping[str, Reference] | None = None,
        contacts: Mapping[str, float] | None = None,
        *,
        weights: Mapping[str, float] | None = None,
        activation: Mapping[str, float] | None = None,
        dt: float | None = None,
    ) -> Command:
        """Return the rotor torques for a state; never raises.

        Args:
            state: position (nq,) and velocity (nv,), as the encoders report them.
            references: task name -> what it should do; see `TaskStack.take` for those left out.
            contacts: name -> greatest normal force [N] of each active contact, infinite for no
                limit. All contacts are active without limit when left out. From tick to tick
                they change by ramps, see `ControllerSettings.contact_ramp`.
            weights: task name -> weight of all its rows in this tick, in place of the task's own.
            activation: task name -> 0 (off) to 1 (on, as when left out), what its weight is
                multiplied with; numbers in between blend a task in or out.
            dt: time until the next tick [s], at most 0.1; that of the settings when left out.
        """
        start, parts, hook = perf_counter(), self._parts, self.settings.state_hook
        if not self._free.acquire(blocking=False):
            return self._fallback.busy(start)
        motion, dt = None, self.settings.time_step if dt is None else dt
        references = {} if references is None else references
        try:
            # what is given
            motion = self._inputs.admitted(state if hook is None else hook(state))
            self._inputs.check(references, contacts, weights, activation, dt)
            motion = parts.drivetrain.true_motion(motion)
            # what is asked and allowed
            levels, ceilings = self._levels.of(contacts, dt)
            for stack in parts.stacks:
                stack.weigh(weights, activation)
            self._ask(motion, references)
            parts.drivetrain.take(motion, levels[0].program.contacts.contacts)
            for level in levels:
                level.program.take(ceilings)
            # level by level
            answer = deeper = self._solve(levels[0], motion, dt, None)
            for level in levels[1:]:
                if not deeper.usable:
                    break
                deeper = self._solve(level, motion, dt, answer)
                answer = answer.followed_by(deeper)
            self._answer = answer
            if answer.usable:
                return self._accepted(answer, motion, start)
            return self._refused(answer, references, motion, start)
        except Exception as cause:  # wrong inputs, or what a hook, a task or an effect may raise
            return self._fallback.command(motion, complaint_of(cause), dt, start)
        finally:
            self._free.release()

    def _ask(self, motion: Motion, references: Mapping[str, Reference]) -> None:
        """Take references, and ask what only Python can say of a state; nothing is remembered."""
        parts, asks = self._parts, self._parts.asks_ahead
        parts.kinematics.take(motion.position, motion.velocity)
        for stack in parts.stacks:
            asks = stack.take(references) or asks
        if asks:
            parts.kinematics.move()
            for stack in parts.stacks:
                stack.ask(parts.kinematics)
            if parts.collision is not None:
                parts.collision.fill(parts.kinematics)

    def _solve(
        self, level: Level, motion: Motion, dt: float, above: LevelAnswer | None
    ) -> LevelAnswer:
        """Return what a level comes to below what is decided above.

        It is the answer above where that leaves nothing to decide.
        """
        start, program, memory = perf_counter(), level.program, level.program.memory
        block = np.empty(program.size)
        if not write(memory, motion.position, motion.velocity, self._last, dt):
            return LevelAnswer(level, block, dt, level.too_large, 0.0, 0)
        if program.repeats:
            program.place_basis()
        if above is not None and level.hold(above) == 0 and not program.has_efforts:
            return above
        ended = guess(memory, block) if level.guesses else UNSOLVED
        if ended == DONE:
            spent, hard = perf_counter() - start, memory.counts[COUNT.hard]
            return LevelAnswer(level, block, dt, level.unsearched, spent, hard)
        found = level.search(above, block if ended == LIMITED_TORQUE else self._last)
        if found.verdict[0].usable:
            block[program.at[PART.x]] = found.solution.x
            place_torques(memory, block)
        return LevelAnswer(level, block, dt, found, level.spent, 0)

    def _accepted(self, answer: LevelAnswer, motion: Motion, start: float) -> Command:
        """Return the command of a tick with a solution; take what the next one starts from."""
        self._last, gears = answer.block, self._parts.drivetrain
        for stack in self._parts.stacks:
            stack.remember()
        self._fallback.remember(answer)
        if gears.learns:
            contacts = answer.level.program.contacts.contacts
            gears.remember(motion.velocity + answer.dt * answer.acceleration, contacts)
        drive = answer.row(GEAR.drive)
        if gears.differs:
            drive = gears.to_drive(motion, answer.row(GEAR.torque))
        status, took = answer.found.verdict[0], perf_counter() - start
        command = Command(rotor_torque=drive, status=status, tick_time=took, prospect=answer)
        if (deadline := self.settings.deadline) is not None and took > deadline:
            command.status = Status.LATE
            command.message = f"{1e3 * took:.2f} ms of {1e3 * deadline:.2f} ms."
        return command

    def _refused(
        self, answer: LevelAnswer, references: Mapping[str, Reference], motion: Motion, start: float
    ) -> Command:
        """Return the safe command of a tick that has no usable solution."""
        complaint = answer.found.verdict
        if complaint[0] is Status.NOT_FINITE:
            complaint = size_complaint(references)
        else:
            for stack in self._parts.stacks:
                stack.remember()
        # the next tick expects the speed that was expected of this one, drawn towards the measured
        self._last, program = self._last.copy(), answer.level.program
        self._last[program.at[PART.advanced]] = program.memory.corrected
        return self._fallback.command(motion, complaint, answer.dt, start, answer)

    @property
    def problem(self) -> QPProblem | None:
        """A copy of the program of the last tick, for inspection; None before the first."""
        answer = self._answer
        return None if answer is None else answer.level.built(self._last, answer.found.decided)

    @property
    def disturbance(self) -> FloatArray:
        """A copy of the torque (nv,) [N m, N] that the observer has learned, zero without one."""
        return np.array(self._parts.drivetrain.memory.disturbance)

    def __reduce__(self) -> NoReturn:
        """Raise TypeError: the parts of a controller share memory that a copy would tear apart."""
        raise TypeError(
            "a Controller is neither copied nor pickled; make another one of the same robot, "
            "tasks, contacts, limits and settings."
        )


@compiled
def write(program: ProgramMemory, position: Vector, velocity: Vector, last: Row, dt: float) -> bool:
    """Write everything that a state decides; return whether the numbers can be solved with.

    Args:
        position, velocity: q (nq,) and v (nv,).
        last: block of the last tick, with v (nv,) [rad/s] expected of this state, and T.
        dt: time until the next tick [s].
    """
    program.position[:], program.velocity[:], program.step[0] = position, velocity, dt
    first, gears = program.ends[PART.by_gear], len(program.output)
    copy_to(last[program.ends[PART.advanced] : first], program.expected)
    copy_to(view(last, first, len(GEAR), gears)[GEAR.output_torque], program.output)
    move_joints(program.tree, program.velocity)  # velocities, and accelerations at qdd = 0
    rest_contacts(program)  # J, and what J qdd must be for contacts to rest
    want(program)  # J, and what J qdd is to be for tasks
    place_loads(program)  # which way gears turn, slopes of the mesh law; effects in the bias
    place_map(program)  # T = D' (M qdd + bias - J' f), torque that leaves the gears
    place_joint_bounds(program)  # qdd between stops, speeds and what motors brake
    total = place_tasks(program) + place_balance(program)  # costs; equalities
    return bool(total < program.numbers[NUMBER.greatest])
