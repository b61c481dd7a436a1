"""Motors as numbers of single joints, for formats that know no coupled gears, drives or springs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.export.joint_numbers import JointNumbers
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class Lumped:
    """What formats say that have numbers per joint only.

    Attributes:
        armature, damping, friction: (nv,), of joint and motor together [kg m^2, N m s/rad, N m].
        limit: (nv,) largest torque of the joint's motor [N m], infinite where there is none.
        speed: (nv,) [rad/s].
        unsaid: what these numbers do not hold.
    """

    armature: FloatArray
    damping: FloatArray
    friction: FloatArray
    limit: FloatArray
    speed: FloatArray
    unsaid: tuple[str, ...]

    @classmethod
    def of(cls, robot: Robot, found: JointNumbers) -> Lumped:
        """Return a robot's numbers per joint; of coupled gears only what acts on a joint alone."""
        gears, rows = robot.transmission, robot.actuated
        armature = np.zeros(robot.model.nv)
        damping, friction = np.array(found.damping), np.array(found.friction)
        limit, speed = np.full((2, robot.model.nv), np.inf)
        turned = gears.motor_from_joint
        armature[rows] = turned.T**2 @ found.motor_armature
        damping[rows] += turned.T**2 @ found.motor_damping
        friction[rows] += np.abs(turned.T) @ found.motor_friction
        limit[rows], speed[rows] = found.motor_limit, found.motor_speed
        unsaid = []
        if np.any(turned != np.diag(np.diag(turned))):
            unsaid.append(
                "the coupling of the gears (topology): each joint has the diagonal of what the "
                "motors reflect, and its own motor's limits"
            )
        return cls(armature, damping, friction, limit, speed, (*unsaid, *_drives(robot, found)))


def _drives(robot: Robot, found: JointNumbers) -> list[str]:
    unsaid = []
    for joint in robot.single_joints:
        row = robot.velocity_index(joint)
        if found.stiffness[row]:
            rest = found.constant[row] / found.stiffness[row]
            unsaid.append(
                f"the spring at {joint} ({found.stiffness[row]:.6g} N m/rad, slack at {rest:.6g})"
            )
        elif found.constant[row]:
            unsaid.append(f"the constant torque at {joint} ({found.constant[row]:.6g} N m)")
    for k, joint in enumerate(robot.transmission.joints):
        if found.gain[k] != 1.0:
            unsaid.append(
                f"torque constant of {joint}: the motor gives {found.gain[k]:.6g} times what is "
                "asked for; multiply the command by it"
            )
        if found.offset[k]:
            unsaid.append(
                f"torque offset of {joint}: {found.offset[k]:.6g} N m; add it to the command"
            )
    return unsaid
