"""Positions that a log holds, and those that follow from a velocity where no place matters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import FloatArray
from wbc.measurement.log import Log
from wbc.robot import Robot

_STATES = 4  # drawn at random; one that does not show a dependence has measure zero
_SAME = 1e-9  # of the torque, what rounding makes


def joint_position(log: Log, joint: str) -> FloatArray:
    """Return the position (N,) of a joint [rad, m], or the integral of its velocity from zero.

    Raises:
        LogError: the log holds neither, or a position that cannot be used.
    """
    if joint not in _of_velocity_alone(log, (joint,)):
        return log.column(f"{joint}.position")
    return np.asarray(cumulative_trapezoid(log.column(f"{joint}.velocity"), log.time, initial=0.0))


def without_position(robot: Robot, log: Log) -> tuple[str, ...]:
    """Return the joints whose velocity a log holds and whose position it lacks."""
    return _of_velocity_alone(log, robot.single_joints)


def _of_velocity_alone(log: Log, joints: Sequence[str]) -> tuple[str, ...]:
    return tuple(
        joint
        for joint in joints
        if not log.recorded(f"{joint}.position") and log.has(f"{joint}.velocity")
    )


def placeless_joints(robot: Robot, joints: Sequence[str]) -> tuple[str, ...]:
    """Return those of `joints` whose position changes neither what the links need nor a contact.

    Such are the shaft of a motor on a test bench and a flywheel: nothing hangs on them that gravity
    could turn, and their inertia is the same at every angle.
    """
    return tuple(joint for joint in joints if not _place_matters(robot, joint))


def _place_matters(robot: Robot, joint: str) -> bool:
    model, data = robot.model, robot.model.createData()
    random, row = np.random.default_rng(0), robot.velocity_index(joint)
    feet = [(model.getFrameId(contact.frame), contact.offset) for contact in robot.contacts]

    def felt(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        torque = pin.rnea(model, data, q, v, a).copy()
        pin.framesForwardKinematics(model, data, q)
        return np.concatenate([torque, *(data.oMf[frame].act(point) for frame, point in feet)])

    for _ in range(_STATES):
        turn, v, a = random.standard_normal((3, model.nv))
        q = pin.integrate(model, robot.neutral(), turn)
        further = np.zeros(model.nv)
        further[row] = 1.0
        here, there = felt(q, v, a), felt(pin.integrate(model, q, further), v, a)
        if np.abs(there - here).max() > _SAME * max(1.0, float(np.abs(here).max())):
            return True
    return False
