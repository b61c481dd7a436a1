"""The controller: from a state and references to rotor torques, every tick."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock
from typing import NoReturn, TypeVar, final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.compiled import make_ready
from wbc.control.drivetrain import GearModel
from wbc.control.fallback import Fallback
from wbc.control.inputs import InputCheck
from wbc.control.kinematics import Kinematics
from wbc.control.qp.level import Levels
from wbc.control.qp.program import Recipe
from wbc.control.qp.solvers import QPProblem
from wbc.control.rows.collision import CollisionLimit, CollisionRows
from wbc.control.rows.contacts import Contact
from wbc.control.rows.limits import Effort, JointLimit, RotorTorqueLimit
from wbc.control.rows.task_stack import TaskStack
from wbc.control.rows.tasks import Task
from wbc.control.settings import ControllerSettings
from wbc.control.tick import Ticker
from wbc.errors import ControlError
from wbc.robot import Robot


@final
class Controller(Ticker):
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
        self.settings = settings = ControllerSettings() if settings is None else settings
        names = _distinct("task", [task.name for task in self.tasks])
        _distinct("contact", [contact.name for contact in contacts])
        limits = (RotorTorqueLimit(), JointLimit()) if limits is None else limits
        self._contacts = {contact.name: contact.bind(robot) for contact in contacts}
        frames = [frame for contact in self._contacts.values() for frame in contact.frames]
        kinematics = Kinematics(robot, frames)
        drivetrain = GearModel(robot, kinematics, settings, _single(RotorTorqueLimit, limits))
        efforts = [task for task in self.tasks if isinstance(task, Effort)]
        weights = [effort.weights(robot) for effort in efforts]
        apart = _single(CollisionLimit, limits)
        stops = _single(JointLimit, limits)
        if stops is None or not stops.joints:
            stops = JointLimit.of(robot, () if stops is None else None)
        self._parts = Recipe(
            robot=robot,
            drivetrain=drivetrain,
            kinematics=kinematics,
            joint_limit=stops,
            joints=stops.structure(robot.model.nv),
            collision=None if apart is None else CollisionRows(apart, kinematics.model),
            settings=settings,
            efforts=np.array(weights).reshape(-1, drivetrain.size),
            effort_kinds=np.array([e.kind for e in efforts]).reshape(-1, 2),
            stacks=_stacks_by_level(robot, self.tasks, kinematics.model),
        )
        weighed = frozenset(task.name for task in self.tasks if isinstance(task, Task))
        self._inputs = InputCheck(robot, names, weighed, tuple(self._contacts))
        self._levels = Levels(self._parts, self._contacts)
        self._fallback = Fallback(self._parts, self._levels.whole)
        self._free, self._answer = Lock(), None
        self.reset()

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

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        for stack in self._parts.stacks:
            stack.forget()
        self._last = np.zeros(self._levels.shared)
        self._parts.joints.load[:] = np.nan
        self._parts.drivetrain.forget()
        self._fallback.remember(None)
        self._levels.forget()


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
