"""What is wrong with the inputs of a tick, said in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import isfinite

import numpy as np

from wbc.arrays import FloatArray
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
    if not isfinite(position.dot(position) + velocity.dot(velocity)):
        return Status.NOT_FINITE, "the state holds a value that is not finite."
    return None


def as_motion(state: State) -> Motion:
    """Return a state as a motion of arrays, itself where it is one."""
    q, v = state.position, state.velocity
    if isinstance(state, Motion) and isinstance(q, np.ndarray) and isinstance(v, np.ndarray):
        return state
    return Motion(np.asarray(q), np.asarray(v))


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
    """Whether the vectors (n,) are finite, by their squared lengths: one pass, no temporaries.

    A vector whose squared length overflows counts as not finite.
    """
    return all(isfinite(vector.dot(vector)) for vector in vectors)
