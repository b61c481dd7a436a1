"""Bristles of rubbing surfaces: how they bend over a way, and what they hold (Dahl's model).

dz/dt = (v - |v| z) / length, with z between -1 and 1 in place of the sign of v.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.robot import Memory, MemoryEnergy, Motion, Robot


def bent_after(before: float, way: float, length: float) -> float:
    """Return z after a way [rad] in one direction from z = `before`: exact."""
    end = float(np.sign(way))
    if end == 0.0 or length <= 0.0:
        return end if end else before
    return float(end + (before - end) * np.exp(-abs(way) / length))


def stepped(
    memory: Memory, speed: float, level: float, length: float, inertia: FloatArray | float
) -> float:
    """Return z at the end of a simulator's step.

    dz/dt is solved exactly for the step's speed, so z stays within -1 and 1 for any step. The
    torque is that of this z, so bristles act as a spring of stiffness level / length does in
    semi-implicit Euler: stable up to 4 inertia / step^2. Bristles stiffer than a quarter of that
    are replaced by the stiffest that the step can carry; smaller steps take them back.

    Args:
        memory: z first in its value.
        speed: [rad/s], the step's.
        level: [N m] of the friction at z = 1.
        length: [rad].
        inertia: [kg m^2] that the friction acts on.
    """
    before = float(memory.value[0])
    if level == 0.0 or speed == 0.0:
        return before
    softest = max(length, level * memory.step**2 / float(inertia))
    return bent_after(before, speed * memory.step, softest)


def inertia_along(robot: Robot, motion: Motion, direction: FloatArray) -> float:
    """Return the inertia [kg m^2] that a torque along `direction` (nv,) alone accelerates."""
    model, gears = robot.model, robot.transmission
    inertia = pin.crba(model, model.createData(), motion.position, pin.Convention.WORLD)
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    rotors = gears.motor_from_joint.T * gears.reflected_inertia @ gears.motor_from_joint
    inertia[np.ix_(robot.actuated, robot.actuated)] += rotors
    return float(1.0 / (direction @ np.linalg.solve(inertia, direction)))


def energy_of_step(
    bent: tuple[float, float], level: tuple[float, float], length: float, work: float
) -> MemoryEnergy:
    """Return where `work` [J] went that bristles took over a step.

    They store level * length * z^2 / 2: by bending, and where the level changes under them.

    Args:
        bent: z before and after.
        level: [N m] before and after.
        length: [rad].
        work: friction torque times way [J].
    """
    reloaded = 0.5 * length * (level[1] - level[0]) * bent[0] ** 2
    bending = 0.5 * length * level[1] * (bent[1] ** 2 - bent[0] ** 2)
    return MemoryEnergy(bending + reloaded, reloaded, max(work - bending, 0.0))
