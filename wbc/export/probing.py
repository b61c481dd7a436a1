"""What an effect does, asked of its hooks: the part of it that is linear, and whether that is all.

No effect is known by its name here, so an effect of a user is exported like one of the catalogue.
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Effect, Motion, Robot

_HELD = 3  # samples whose drives must have one law
_HELD_FIELDS = ("position", "velocity", "acceleration", "temperature", "supply_voltage")
_SAMPLES = 64
_EXACT = 1e-9  # of the largest value, up to which rounding may leave a linear law
_TORQUE = 1e4  # [N m] at the motor output, up to which a drive must be linear


def probe_motion(robot: Robot) -> Motion:
    """Return a random motion (64, ...) with everything that a hook may look at."""
    random = np.random.default_rng(0)
    model, size = robot.model, robot.transmission.size
    position = np.tile(robot.neutral(), (_SAMPLES, 1))
    for joint in robot.single_joints:
        position[:, robot.position_index(joint)] = random.uniform(-1.0, 1.0, _SAMPLES)
    return Motion(
        position=position,
        velocity=random.uniform(-3.0, 3.0, (_SAMPLES, model.nv)),
        acceleration=random.uniform(-5.0, 5.0, (_SAMPLES, model.nv)),
        time=np.linspace(0.0, 10.0, _SAMPLES),
        temperature=random.uniform(20.0, 60.0, (_SAMPLES, size)),
        supply_voltage=random.uniform(12.0, 48.0, (_SAMPLES, size)),
    )


def joint_law(robot: Robot, effect: Effect, motion: Motion) -> FloatArray | None:
    """Return the smooth law (3, nv) of an effect at the joints, None if it has another one.

    The torque [N m] is constant - stiffness q - damping v.
    """
    torque, law = effect.joint_torque(robot, motion), np.zeros((3, robot.model.nv))
    if torque is None:
        return law
    said = np.zeros_like(torque)
    for joint in robot.single_joints:
        row, place = robot.velocity_index(joint), motion.position[:, robot.position_index(joint)]
        columns = np.stack([np.ones_like(place), -place, -motion.velocity[:, row]], axis=1)
        law[:, row] = np.linalg.lstsq(columns, torque[:, row], rcond=None)[0]
        said[:, row] = columns @ law[:, row]
    law[np.abs(law) <= _EXACT * np.abs(torque).max(axis=0)] = 0.0
    return law if _equal(said, torque) else None


def constant(values: FloatArray | None, size: int) -> FloatArray | None:
    """Return the one row (size,) of what a hook returned, zeros for nothing, None for several."""
    if values is None:
        return np.zeros(size)
    return values[0] if _equal(values, np.broadcast_to(values[0], values.shape)) else None


def drive_law(robot: Robot, effect: Effect, motion: Motion) -> FloatArray | None:
    """Return gain and delay (2, m) of the drives with an effect, None if it does other things.

    A torque that grows evenly from far below any limit to far above it is delivered late by a
    shift and weakened by a slope; whatever else happens to it shows as a bend. What depends on
    the speed, the temperature or the supply differs from one held sample of `motion` to the next.
    """
    size, time, laws = robot.transmission.size, np.linspace(0.0, 10.0, 2001), []
    if "drive" not in effect.acts_by:
        return np.array([np.ones(size), np.zeros(size)])
    inner = slice(200, -200)  # a delay has nothing to show before the first sample
    ramp, unit = (time - 5.0) / 5.0, _TORQUE / np.abs(robot.transmission.gear_ratio)
    given = {name: getattr(motion, name) for name in _HELD_FIELDS}
    for row in range(_HELD):
        held = {n: np.tile(x[row], (time.size, 1)) for n, x in given.items() if x is not None}
        sample = motion.replace(time=time, **held)
        delivered = effect.drive(robot, sample, np.outer(ramp, unit))[inner] / unit
        gain, shift = np.polyfit(ramp[inner], delivered, 1)
        if not _equal(np.outer(ramp[inner], gain) + shift, delivered):
            return None
        gain[np.abs(gain - 1.0) < _EXACT] = 1.0
        delay = np.divide(-5.0 * shift, gain, out=np.zeros(size), where=gain != 0.0)
        laws.append(np.array([gain, np.where(np.abs(delay) < _EXACT, 0.0, delay)]))
    return laws[0] if all(np.array_equal(law, laws[0]) for law in laws) else None


def _equal(one: FloatArray, other: FloatArray) -> bool:
    size = max(float(np.max(np.abs(other), initial=0.0)), 1e-300)
    return bool(np.max(np.abs(one - other), initial=0.0) <= _EXACT * size)
