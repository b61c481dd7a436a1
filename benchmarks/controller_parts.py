"""A tick of the controller taken apart, with a clock between its parts."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.controller_scenes import controller
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.kinematics import Kinematics
from wbc.control.program.level import Level
from wbc.control.program.task_stack import TaskStack
from wbc.control.solvers import DualActiveSet

PARTS = (
    ((Kinematics, "update"),),
    ((TaskStack, "fill"), (ContactSet, "fill")),
    ((Level, "assemble"),),
    ((DualActiveSet, "guess"),),
    ((Level, "_realise"),),
)


def parts(robot, states):
    """Return the median processor time [us] of each of PARTS and of the rest of a tick."""
    spent = np.zeros((len(states), len(PARTS) + 1))
    kept = []
    for column, methods in enumerate(PARTS):
        for owner, name in methods:
            kept.append((owner, name, getattr(owner, name)))
            setattr(owner, name, _clocked(getattr(owner, name), spent, column))
    try:
        contestant = controller(robot)
        for number, tick in enumerate(states):
            _clocked.number = number
            start = time.perf_counter_ns()
            contestant.step(tick.motion, tick.references, tick.contacts)
            spent[number, -1] = 1e-3 * (time.perf_counter_ns() - start)
    finally:
        for owner, name, method in kept:
            setattr(owner, name, method)
    spent[:, -1] -= spent[:, :-1].sum(axis=1)
    return np.median(spent, axis=0)


def _clocked(method, spent, column):
    """Return the method with a clock around it."""

    def timed(*arguments):
        start = time.perf_counter_ns()
        try:
            return method(*arguments)
        finally:
            spent[_clocked.number, column] += 1e-3 * (time.perf_counter_ns() - start)

    return timed


_clocked.number = 0
