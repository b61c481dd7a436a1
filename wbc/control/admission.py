"""What a controller is told when it is made: checked, and sorted by what it is for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import pinocchio as pin

from wbc.control.contacts import BoundContact
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.limits import JointLimit, RotorTorqueLimit
from wbc.control.program.task_stack import TaskStack
from wbc.control.tasks import Task
from wbc.errors import ControlError, unknown_name
from wbc.robot import Robot

_Limit = TypeVar("_Limit", RotorTorqueLimit, JointLimit)


def checked_names(kind: str, names: Sequence[str]) -> frozenset[str]:
    """Return the names of things of a kind after checking that they differ."""
    for name in names:
        if names.count(name) > 1:
            raise ControlError(f"two {kind}s are called '{name}'; names must differ.")
    return frozenset(names)


def stacks_by_level(
    robot: Robot, tasks: Sequence[object], model: pin.Model
) -> tuple[TaskStack, ...]:
    """Return the stacks of level 0 and of level 1, the latter only where it has a task."""
    moving = [task for task in tasks if isinstance(task, Task)]
    upper = [task for task in moving if task.level == 0]
    lower = [task for task in moving if task.level == 1]
    if not upper:
        raise ControlError("a controller without tasks of level 0 has nothing to do.")
    return tuple(TaskStack(robot, level, model) for level in (upper, lower) if level)


def checked_efforts(robot: Robot, tasks: Sequence[object]) -> tuple[Effort, ...]:
    """Return the efforts among the tasks after checking that they fit the robot."""
    efforts = tuple(task for task in tasks if isinstance(task, Effort))
    for effort in efforts:
        effort.check(robot)
    return efforts


def checked_force_tasks(
    tasks: Sequence[object], contacts: Mapping[str, BoundContact]
) -> tuple[ContactForceTask, ...]:
    """Return the contact-force tasks among the tasks after checking that their contacts exist."""
    found = tuple(task for task in tasks if isinstance(task, ContactForceTask))
    for task in found:
        if task.contact not in contacts:
            raise ControlError(
                f"task '{task.name}': " + unknown_name("contact", task.contact, contacts)
            )
    return found


def single_limit(kind: type[_Limit], limits: Sequence[object]) -> _Limit | None:
    """Return the limit of a kind, None where there is none; two of a kind would contradict."""
    found = [limit for limit in limits if isinstance(limit, kind)]
    if len(found) > 1:
        raise ControlError(f"at most one {kind.__name__} can be given.")
    return found[0] if found else None
