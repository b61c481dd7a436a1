"""What is wrong with the inputs of a tick, said in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import isfinite

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Flag, Vector, compiled
from wbc.control.command import Status
from wbc.control.reference import Reference
from wbc.control.state import State
from wbc.errors import unknown_name
from wbc.robot import Motion, Robot

Complaint = tuple[Status, str]


def state_complaint(robot: Robot, position: FloatArray, velocity: FloatArray) -> Complaint | None:
    """Return what is wrong with a state, None if nothing is."""
    model = robot.model
    if position.shape != (model.nq,) or velocity.shape != (model.nv,):
        return Status.BAD_INPUT, (
            f"'{robot.name}' needs q of shape ({model.nq},) and v of shape ({model.nv},)."
        )
    if not (finite(position) and finite(velocity)):
        return Status.NOT_FINITE, "the state holds a value that is not finite."
    return None


def as_motion(state: State) -> Motion:
    """Return a state as a motion of arrays, itself where it is one."""
    q, v = state.position, state.velocity
    if isinstance(state, Motion) and _of_floats(q) and _of_floats(v):
        return state
    return Motion(_floats(q), _floats(v))


def _of_floats(values: object) -> bool:
    return isinstance(values, np.ndarray) and values.dtype == np.float64


def _floats(values: object) -> FloatArray:
    """Return an array of the values, empty where they are no numbers."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return np.zeros(0)


def name_complaint(
    references: Mapping[str, Reference],
    tasks: Collection[str],
    active: Mapping[str, float] | None,
    contacts: Collection[str],
) -> Complaint | None:
    """Return what is wrong with the names and limits given, None if nothing is."""
    for name in references:
        if name not in tasks:
            return Status.BAD_INPUT, unknown_name("task", name, tasks)
    if active is None:
        return None
    for name, limit in active.items():
        if name not in contacts:
            return Status.BAD_INPUT, unknown_name("contact", name, contacts)
        if not limit >= 0.0:
            return Status.BAD_INPUT, f"the force limit of contact '{name}' is {limit}."
    return None


def overflow_complaint(references: Mapping[str, Reference]) -> Complaint:
    """Return why the program of a finite state holds a number that is not finite."""
    for name, reference in references.items():
        if not reference.is_finite():
            return Status.NOT_FINITE, f"the reference of task '{name}' is not finite."
    return Status.NOT_FINITE, "the dynamics overflow at this state."


def all_finite(*vectors: FloatArray) -> bool:
    """Whether the vectors (n,) are finite; see `finite`."""
    return all(finite(vector) for vector in vectors)


@compiled(Flag, Vector)
def finite(vector: FloatArray) -> bool:
    """Whether a vector (n,) is finite; one whose squared length overflows counts as not."""
    length = 0.0
    for i in range(len(vector)):
        length += vector[i] * vector[i]
    return isfinite(length)
