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


Numbers = tuple[float, ...]
"""Of a law: of a joint the constant, the stiffness and the damping; of a drive gain and delay."""


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


def joint_law(robot: Robot, effect: Effect, motion: Motion) -> dict[str, Numbers] | None:
    """Return the law of every joint that an effect pushes smoothly, None if it has another law.

    The torque [N m] is constant - stiffness q - damping v.
    """
    torque = effect.joint_torque(robot, motion)
    if torque is None:
        return {}
    laws = {}
    for number, joint in enumerate(robot.joints, 1):
        row = robot.velocity_index(joint)
        if not np.any(torque[:, row : row + robot.model.joints[number].nv]):
            continue
        if joint not in robot.single_joints:
            return None
        place = motion.position[:, robot.position_index(joint)]
        speed = motion.velocity[:, row]
        columns = np.stack([np.ones_like(place), -place, -speed], axis=1)
        found = np.linalg.lstsq(columns, torque[:, row], rcond=None)[0]
        if not _equal(columns @ found, torque[:, row]):
            return None
        small = _EXACT * np.abs(torque[:, row]).max()
        laws[joint] = tuple(float(x) if abs(x) > small else 0.0 for x in found)
    return laws


def constant(values: FloatArray | None, size: int) -> FloatArray | None:
    """Return the one row (size,) of what a hook returned, zeros for nothing, None for several."""
    if values is None:
        return np.zeros(size)
    return values[0] if _equal(values, np.broadcast_to(values[0], values.shape)) else None


def drive_laws(robot: Robot, effect: Effect, motion: Motion) -> dict[str, Numbers] | None:
    """Return gain and delay of every drive that an effect changes, None if it does other things.

    A torque that grows evenly from far below any limit to far above it is delivered late by a
    shift and weakened by a slope; whatever else happens to it shows as a bend. What depends on
    the speed, the temperature or the supply differs from one held sample of `motion` to the next.
    """
    if "drive" not in effect.acts_by:
        return {}
    first, *others = (_drive_laws_at(robot, effect, motion, row) for row in range(_HELD))
    return first if all(other == first for other in others) else None


def _drive_laws_at(
    robot: Robot, effect: Effect, motion: Motion, row: int
) -> dict[str, Numbers] | None:
    """Return the laws of the drives while one sample of a motion is held."""
    gears = robot.transmission
    time = np.linspace(0.0, 10.0, 2001)

    given = {name: getattr(motion, name) for name in _HELD_FIELDS}
    still = {name: np.tile(x[row], (time.size, 1)) for name, x in given.items() if x is not None}
    sample = motion.replace(time=time, **still)
    torque = np.outer((time - 5.0) / 5.0, _TORQUE / np.abs(gears.gear_ratio))
    delivered = effect.drive(robot, sample, torque)
    inner = slice(200, -200)  # a delay has nothing to show before the first sample
    laws: dict[str, Numbers] = {}
    for k, joint in enumerate(gears.joints):
        if np.array_equal(delivered[:, k], torque[:, k]):
            continue
        slope, shift = np.polyfit(time[inner], delivered[inner, k], 1)
        if not _equal(slope * time[inner] + shift, delivered[inner, k]):
            return None
        rate = float(torque[-1, k] - torque[0, k]) / 10.0
        gain = float(slope) / rate
        delay = 0.0 if gain == 0.0 else -5.0 - float(shift) / float(slope)
        laws[joint] = (gain, delay if abs(delay) > 1e-9 else 0.0)
    return laws


def _equal(one: FloatArray, other: FloatArray) -> bool:
    size = max(float(np.max(np.abs(other), initial=0.0)), 1e-300)
    return bool(np.max(np.abs(one - other), initial=0.0) <= _EXACT * size)
