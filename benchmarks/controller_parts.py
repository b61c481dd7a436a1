"""A usual tick of the controller taken apart, with a clock between its parts."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.controller_scenes import controller
from wbc.control.kinematics import Kinematics
from wbc.control.outcome import Outcome
from wbc.control.program.usual_tick import UsualTick
from wbc.control.safety.inputs import StateCheck

PARTS = (
    (StateCheck, "admitted"),
    (UsualTick, "prepare"),
    (Kinematics, "take"),
    (UsualTick, "run"),
    (Outcome, "usual"),
)


def parts(robot, states):
    """Return the median time [us] of each of PARTS and of the rest of a tick.

    The planar leg's balancing commands in its own way: none of its ticks is a usual one.
    """
    spent = np.zeros((len(states), len(PARTS) + 1))
    kept = []
    for column, (owner, name) in enumerate(PARTS):
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
    spent[:, 3] -= spent[:, 2]  # the pass takes the state
    spent[:, -1] -= spent[:, :-1].sum(axis=1)
    return np.median(spent, axis=0)


def _clocked(method, spent, column):
    """Return the method with a clock around it."""

    def timed(*arguments, **more):
        start = time.perf_counter_ns()
        try:
            return method(*arguments, **more)
        finally:
            spent[_clocked.number, column] += 1e-3 * (time.perf_counter_ns() - start)

    return timed


_clocked.number = 0
