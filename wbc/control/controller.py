"""The controller: from a state and references to rotor torques, every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from threading import Lock
from time import perf_counter
from typing import NoReturn, TypeVar

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.compiled import make_ready
from wbc.control.command import Command, Refused, Status
from wbc.control.drivetrain import GearModel
from wbc.control.fallback import Fallback
from wbc.control.inputs import (
    Complaint,
    InputCheck,
    Reference,
    State,
    TickInputError,
    size_complaint,
)
from wbc.control.kinematics import Kinematics
from wbc.control.qp.level import Level, Levels, Refusal, SolvedLevel, descend
from wbc.control.qp.program import Recipe
from wbc.control.qp.solvers import QPProblem
from wbc.control.rows.collision import CollisionLimit, CollisionRows
from wbc.control.rows.contacts import Contact, ContactSet
from wbc.control.rows.efforts import Effort
from wbc.control.rows.limits import JointLimit, RotorTorqueLimit
from wbc.control.rows.task import Task
from wbc.control.rows.task_stack import TaskStack
from wbc.control.settings import ControllerSettings
from wbc.control.tick import DRIVE, TORQUE_ROW
from wbc.errors import ControlError
from wbc.robot import Motion, Robot

_BUSY: Complaint = (
    Status.BAD_INPUT,
    "step is called while another thread is in it; give every thread a controller of its own.",
)


class Controller:
    """Whole-body controller of a robot with lossy gears.

    Each tick solves the contact-force program (accelerations and contact forces under the
    dissipative equation of motion, see `ContactForceProgram`) and realises its output torques
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
        self.settings = settings = ControllerSettings() if settings is None else settings
        names = _distinct("task", [task.name for task in self.tasks])
        _distinct("contact", [contact.name for contact in contacts])
        limits = (RotorTorqueLimit(), JointLimit()) if limits is None else limits
        self._contacts = {contact.name: contact.bind(robot) for contact in contacts}
        frames = [f for bound in self._contacts.values() for f in bound.frames]
        self._kinematics = Kinematics(robot, frames)
        self._stacks = _stacks_by_level(robot, self.tasks, self._kinematics.model)
        motors = _single(RotorTorqueLimit, limits)
        self._drivetrain = GearModel(robot, self._kinematics, settings, motors)
        bound = tuple(self._contacts.values())
        self._fallback = Fallback(robot, self._drivetrain, settings, bound)
        efforts = [task for task in self.tasks if isinstance(task, Effort)]
        weights = [effort.weights(robot) for effort in efforts]
        weighed = frozenset(task.name for task in self.tasks if isinstance(task, Task))
        self._inputs = InputCheck(robot, names, weighed, tuple(self._contacts))
        stops, apart = _single(JointLimit, limits), _single(CollisionLimit, limits)
        joint_limit = JointLimit() if stops is None else stops
        if stops is not None and not stops.joints:
            joint_limit = JointLimit.of(robot)
        self._collision = None if apart is None else CollisionRows(apart, self._kinematics.model)
        self._joints = joint_limit.structure(robot.model.nv)
        recipe = Recipe(
            robot=robot,
            drivetrain=self._drivetrain,
            kinematics=self._kinematics,
            joint_limit=joint_limit,
            joints=self._joints,
            collision=self._collision,
            settings=settings,
            efforts=np.array(weights).reshape(-1, self._drivetrain.size),
            effort_kinds=np.array([e.kind for e in efforts]).reshape(-1, 2),
            stacks=self._stacks,
        )
        self._levels = Levels(recipe, self._contacts)
        alone = self._kinematics.known_by_joints and not self._drivetrain.coupled
        self._asks_ahead = not alone or self._collision is not None
        self._free = Lock()
        self._level: Level | None = None
        self.reset()

    @property
    def problem(self) -> QPProblem | None:
        """A copy of the program of the last tick, for inspection; None before the first."""
        return None if self._level is None else self._level.built(self._last)

    @property
    def disturbance(self) -> FloatArray:
        """A copy of the torque (nv,) [N m, N] that the observer has learned, zero without one."""
        return np.array(self._drivetrain.memory.disturbance)

    def __reduce__(self) -> NoReturn:
        """Raise TypeError: the parts of a controller share memory that a copy would tear apart."""
        raise TypeError(
            "a Controller is neither copied nor pickled; make another one of the same robot, "
            "tasks, contacts, limits and settings."
        )

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        for stack in self._stacks:
            stack.forget()
        self._last: FloatArray = np.zeros(self._levels.shared)  # block of results
        self._joints.load[:] = np.nan
        self._drivetrain.forget()
        self._fallback.forget()
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
            references: task name -> what it should do; see `TaskStack.fill` for those left out.
            contacts: name -> greatest normal force [N] of each active contact, infinite for no
                limit. All contacts are active without limit when left out. From tick to tick
                they change by ramps, see `ControllerSettings.contact_ramp`.
            weights: task name -> weight of all its rows in this tick, in place of the task's own.
            activation: task name -> 0 (off) to 1 (on, as when left out), what its weight is
                multiplied with; numbers in between blend a task in or out.
            dt: time until the next tick [s], at most 0.1; that of the settings when left out.
        """
        start = perf_counter()
        if not self._free.acquire(blocking=False):
            return self._fallback.busy(_BUSY, start)
        motion, hook, step = None, self.settings.state_hook, self.settings.time_step
        step = step if dt is None else dt
        references = {} if references is None else references
        try:
            motion = self._inputs.admitted(state if hook is None else hook(state))
            self._inputs.check(references, contacts, weights, activation, step)
            motion = self._drivetrain.true_motion(motion)
            levels, ceilings = self._levels.of(contacts, step)
            for stack in self._stacks:
                stack.weigh(weights, activation)
            self._ask(motion, references, levels[0].program.contacts)
            answer = descend(levels, motion, ceilings, step, self._last)
            self._level = answer.level
            if isinstance(answer, SolvedLevel):
                return self._accepted(answer, motion, start)
            complaint = answer.complaint or size_complaint(references)
            return self._refused(answer, complaint, motion, step, start)
        except TickInputError as cause:
            return self._fallback.command(motion, (cause.status, str(cause)), step, start)
        except Exception as cause:  # what a hook, a task or an effect of the user's own may raise
            complaint = Status.FAILED, f"{type(cause).__name__}: {cause}"
            return self._fallback.command(motion, complaint, step, start)
        finally:
            self._free.release()

    def _ask(
        self, motion: Motion, references: Mapping[str, Reference], contacts: ContactSet
    ) -> None:
        """Write what only Python can say of a state; nothing is remembered.

        Raises:
            TickInputError: a reference that does not fit its task.
        """
        kinematics, asks = self._kinematics, self._asks_ahead
        kinematics.take(motion.position, motion.velocity)
        for stack in self._stacks:
            asks = stack.take(references) or asks
        if asks:
            kinematics.move()
            for stack in self._stacks:
                stack.ask(kinematics)
            if self._collision is not None:
                self._collision.fill(kinematics)
        self._drivetrain.take(motion, contacts.contacts)

    def _accepted(self, answer: SolvedLevel, motion: Motion, start: float) -> Command:
        """Return the command of a tick with a solution; take what the next one starts from."""
        for stack in self._stacks:
            stack.remember()
        self._last, contacts = answer.block, answer.level.program.contacts.contacts
        self._fallback.remember(answer, contacts)
        if self._drivetrain.learns:
            leads_to = motion.velocity + answer.dt * answer.acceleration
            self._drivetrain.remember(leads_to, contacts)
        drive, status = answer.row(DRIVE), answer.verdict[0]
        if self._drivetrain.differs:
            drive = self._drivetrain.to_drive(motion, answer.row(TORQUE_ROW))
        elapsed, deadline = perf_counter() - start, self.settings.deadline
        command = Command(rotor_torque=drive, status=status, tick_time=elapsed, prospect=answer)
        if deadline is not None and elapsed > deadline:
            command.status = Status.LATE
            command.message = f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
        return command

    def _refused(
        self, refusal: Refusal, complaint: Complaint, motion: Motion, dt: float, start: float
    ) -> Command:
        """Return the safe command of a tick that has no usable solution."""
        if complaint[0] is not Status.NOT_FINITE:
            for stack in self._stacks:
                stack.remember()
        self._last, found = refusal.level.expecting(self._last), refusal.found
        program = refusal.level.program
        refused = None if found is None else Refused(program.dense(), program)
        return self._fallback.command(motion, complaint, dt, start, found, refused)


_Limit = TypeVar("_Limit", RotorTorqueLimit, JointLimit, CollisionLimit)


def _distinct(kind: str, names: Sequence[str]) -> frozenset[str]:
    """Return the names of things of a kind after checking that they differ."""
    for name in names:
        if names.count(name) > 1:
            raise ControlError(f"two {kind}s are called '{name}'; names must differ.")
    return frozenset(names)


def _stacks_by_level(
    robot: Robot, tasks: Sequence[object], model: pin.Model
) -> tuple[TaskStack, ...]:
    """Return a stack for every level that has a task, the most important first."""
    moving = [task for task in tasks if isinstance(task, Task)]
    ranks = sorted({task.level for task in moving})
    if not ranks or ranks[0] != 0:
        raise ControlError("a controller without tasks of level 0 has nothing to do.")
    return tuple(
        TaskStack(robot, [task for task in moving if task.level == rank], model) for rank in ranks
    )


def _single(kind: type[_Limit], limits: Sequence[object]) -> _Limit | None:
    """Return the limit of a kind, None where there is none; two of a kind would contradict."""
    found = [limit for limit in limits if isinstance(limit, kind)]
    if len(found) > 1:
        raise ControlError(f"at most one {kind.__name__} can be given.")
    return found[0] if found else None
