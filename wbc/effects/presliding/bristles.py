"""Bristles of rubbing surfaces: how they bend over a way, and what they hold (Dahl's model).

dz/dt = (v - |v| z) / length, with z between -1 and 1 in place of the sign of v. The functions take
the bristles of several places at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.robot import Memory, MemoryEnergy, Motion, Robot


def bent_after(before: FloatArray, way: FloatArray, length: FloatArray) -> FloatArray:
    """Return z (...) after a way [rad] in one direction from z = `before`: exact."""
    end = np.sign(way)
    # Where the length is zero the bristle follows at once.
    gone = np.abs(way) / np.where(length > 0.0, length, np.finfo(np.float64).tiny)
    return np.asarray(np.where(end == 0.0, before, end + (before - end) * np.exp(-gone)))


def stepped(
    memory: Memory,
    speed: FloatArray,
    level: FloatArray,
    length: ArrayLike,
    inertia: Callable[[], FloatArray],
) -> FloatArray:
    """Return z (...) at the end of a simulator's step.

    dz/dt is solved exactly for the step's speed, so z stays within -1 and 1 for any step. The
    torque is that of this z, so bristles act as a spring of stiffness level / length does in
    semi-implicit Euler: stable up to 4 inertia / step^2. Bristles stiffer than a quarter of that
    are replaced by the stiffest that the step can carry; smaller steps take them back.

    Args:
        memory: z first in its value.
        speed: (...) [rad/s], the step's.
        level: (...) [N m] of the friction at z = 1.
        length: (...) [rad].
        inertia: returns (...) [kg m^2] that the friction acts on; asked where something bends.
    """
    before = np.reshape(memory.value[0], np.shape(speed))
    bends = (level != 0.0) & (speed != 0.0)
    if not np.any(bends):
        return before
    softest = np.maximum(length, level * memory.step**2 / inertia())
    return np.where(bends, bent_after(before, speed * memory.step, softest), before)


def inertia_along(robot: Robot, motion: Motion, direction: FloatArray) -> FloatArray:
    """Return the inertia (...) [kg m^2] that a torque along `direction` (..., nv) accelerates.

    The torque acts alone.
    """
    model, gears = robot.model, robot.transmission
    inertia = pin.crba(model, model.createData(), motion.position, pin.Convention.WORLD)
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    rotors = gears.motor_from_joint.T * gears.reflected_inertia @ gears.motor_from_joint
    inertia[np.ix_(robot.actuated, robot.actuated)] += rotors
    moved = np.linalg.solve(inertia, direction.T).T
    return np.asarray(1.0 / np.sum(direction * moved, axis=-1))


def energy_of_step(
    bent: tuple[FloatArray, FloatArray],
    level: tuple[ArrayLike, ArrayLike],
    length: ArrayLike,
    work: FloatArray,
) -> MemoryEnergy:
    """Return where `work` (...) [J] went that bristles took over a step, all of them together.

    They store level * length * z^2 / 2: by bending, and where the level changes under them.

    Args:
        bent: z (...) before and after.
        level: (...) [N m] before and after.
        length: (...) [rad].
        work: friction torque times way [J].
    """
    reloaded = 0.5 * np.multiply(length, np.subtract(level[1], level[0])) * bent[0] ** 2
    bending = 0.5 * np.multiply(length, level[1]) * (bent[1] ** 2 - bent[0] ** 2)
    lost = np.maximum(work - bending, 0.0)
    sums = (float(np.sum(part)) for part in (bending + reloaded, reloaded, lost))
    return MemoryEnergy(*sums)
