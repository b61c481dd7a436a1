"""What the effects of a robot exert in the plant, through their generic hooks alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Motion, Robot


@dataclass(frozen=True, eq=False, slots=True)
class EffectForces:
    """Forces of all effects at one state.

    Attributes:
        joint: smooth torque on the coordinates (nv,).
        friction: level of dry friction on the coordinates (nv,), None where no effect has any.
        rotor: torque delivered on the rotors (m,), the drive's and what effects add to it.
    """

    joint: FloatArray
    friction: FloatArray | None
    rotor: FloatArray


def effect_forces(robot: Robot, motion: Motion, command: FloatArray) -> EffectForces:
    """Return what the effects do with a commanded rotor torque (m,) at a motion."""
    joint = np.zeros(robot.model.nv)
    friction: FloatArray | None = None
    rotor = command
    for effect in robot.effects:
        rotor = effect.drive(robot, motion, rotor)
        smooth = effect.joint_torque(robot, motion)
        if smooth is not None:
            joint += smooth
        level = effect.joint_friction(robot, motion)
        if level is not None:
            friction = level if friction is None else friction + level
    for effect in robot.effects:
        added = effect.rotor_torque(robot, motion)
        if added is not None:
            rotor = rotor + added
    return EffectForces(joint, friction, rotor)
