"""Axis, name and unit of the coordinates of a robot."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot.robot import Robot


def joint_axis(robot: Robot, joint: str) -> FloatArray:
    """Return the axis (3,) of a joint with one degree of freedom, in the joint's frame."""
    linear, angular = _unit_twist(robot, joint)
    axis = angular if np.linalg.norm(angular) > 0.5 else linear
    return np.asarray(axis / np.linalg.norm(axis))


def slides(robot: Robot, joint: str) -> bool:
    """Return whether a joint with one degree of freedom is prismatic."""
    return bool(np.linalg.norm(_unit_twist(robot, joint)[1]) < 0.5)


def unit_at(robot: Robot, where: str, unit: str) -> str:
    """Return the unit of a number of an effect at a place.

    The units of effects are those of joints that turn. At a joint that slides a torque is a force,
    an angle a length and an inertia a mass.

    Args:
        robot: that has the effect.
        where: its joint or body.
        unit: of its parameter.
    """
    if where not in robot.single_joints or not slides(robot, where):
        return unit
    return unit.replace("kg m^2", "kg").replace("N m", "N").replace("rad", "m")


def output_units(robot: Robot) -> tuple[str, ...]:
    """Return the unit of every output of a residual: driven joints, then the other coordinates."""
    units = ["N m"] * robot.model.nv
    for name in robot.joints:
        joint = robot.model.joints[robot.model.getJointId(name)]
        if joint.nv == 6:
            units[joint.idx_v : joint.idx_v + 3] = ["N"] * 3
        elif joint.nv == 1 and slides(robot, name):
            units[joint.idx_v] = "N"
    return tuple(units[row] for row in (*robot.actuated, *robot.unactuated))


def _unit_twist(robot: Robot, joint: str) -> tuple[FloatArray, FloatArray]:
    own = robot.model.createData().joints[robot.model.getJointId(joint)]
    motion = np.asarray(own.S).reshape(6, -1)[:, 0]
    return motion[:3], motion[3:]
