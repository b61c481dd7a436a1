"""A robot in the words of other simulators: numbers per joint, and the losses of its gears.

What an effect does is asked of its hooks: the part of it that is linear, and whether that is all.
No effect is known by its name here, so an effect of a user is exported like one of the catalogue;
only the losses that `wbc.export.losses` works with have names.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import LoadPresliding, LoadStribeckFriction, Presliding, StribeckFriction
from wbc.errors import RobotError
from wbc.robot import Effect, Motion, Robot

_HELD = 3  # samples whose drives must have one law
_HELD_FIELDS = ("position", "velocity", "acceleration", "temperature", "supply_voltage")
_SAMPLES = 64
_EXACT = 1e-9  # of the largest value, up to which rounding may leave a linear law
_TORQUE = 1e4  # [N m] at the motor output, up to which a drive must be linear
_KINDS = (LoadPresliding, LoadStribeckFriction, Presliding, StribeckFriction)
TOLD = ("transmission_efficiency", *(kind.name for kind in _KINDS))
"""Names of the effects that these numbers hold beside what stands in every exported file."""


@dataclass(frozen=True, eq=False)
class JointNumbers:
    """What simulators can be told about joints and motors, beside the links' inertias.

    Attributes:
        damping: (nv,) [N m s/rad].
        friction: (nv,) level of dry friction [N m].
        stiffness: (nv,) of springs beside the joints [N m/rad].
        constant: (nv,) torque of these springs at position zero [N m].
        motor_damping: (m,) viscous friction of each rotor, at the motor's output [N m s/rad].
        motor_friction: (m,) dry friction of each rotor, at the motor's output [N m].
        motor_limit: (m,) torque at the motor's output [N m], infinite where there is none.
        gain: (m,) delivered over reported torque.
        offset: (m,) delivered minus reported torque at the motor's output [N m].
        delay: (m,) [s].
        unsaid: sentences on what none of these numbers holds.
    """

    damping: FloatArray
    friction: FloatArray
    stiffness: FloatArray
    constant: FloatArray
    motor_damping: FloatArray
    motor_friction: FloatArray
    motor_limit: FloatArray
    gain: FloatArray
    offset: FloatArray
    delay: FloatArray
    unsaid: tuple[str, ...]


def joint_numbers(robot: Robot, told: Container[str] = ()) -> JointNumbers:
    """Return the numbers of a robot with its effects, each asked for what it does.

    Args:
        robot: with its effects.
        told: names of effects that are told elsewhere, `transmission_efficiency` for what the
            gears lose under load.
    """
    gears, ratio = robot.transmission, np.abs(robot.transmission.gear_ratio)
    damping, friction, stiffness, constants = np.zeros((4, robot.model.nv))
    found = JointNumbers(
        damping,
        friction,
        stiffness,
        constants,
        motor_damping=ratio**2 * gears.rotor_viscous_friction,
        motor_friction=ratio * gears.rotor_coulomb_friction,
        motor_limit=ratio * gears.torque_limit,
        gain=np.ones(gears.size),
        offset=np.zeros(gears.size),
        delay=np.zeros(gears.size),
        unsaid=tuple(_of_gears(robot, "transmission_efficiency" in told)),
    )
    effects, motion = (e for e in robot.effects if e.name not in told), _probe_motion(robot)
    unsaid = [text for effect in effects for text in _add(robot, effect, motion, found)]
    return replace(found, unsaid=(*found.unsaid, *dict.fromkeys(unsaid)))


def _of_gears(robot: Robot, losses_told: bool) -> Iterator[str]:
    gears = robot.transmission
    for k, joint in enumerate(gears.joints):
        forward, backward = gears.forward_efficiency[k], gears.backward_efficiency[k]
        if not losses_told and (forward != 1.0 or backward != 1.0):
            yield (
                f"losses in the gear at {joint} (forward efficiency {forward:.3g}, backward "
                f"efficiency {backward:.3g}): the exported gear loses nothing that grows with "
                "the load"
            )
        if np.isfinite(gears.stiffness[k]):
            yield (
                f"the spring in the gear at {joint} ({gears.stiffness[k]:.3g} N m/rad): the "
                "exported gear is rigid"
            )
        if gears.backlash[k] > 0.0:
            yield f"the play in the gear at {joint} ({gears.backlash[k]:.3g} rad)"
    if robot.rotors_turn_with_links:
        yield "the rotors' reaction to the turning of their housings"


def _add(robot: Robot, effect: Effect, motion: Motion, found: JointNumbers) -> Iterator[str]:
    """Add what an effect does to the numbers found; yield what they cannot hold."""
    law, drives = _joint_law(robot, effect, motion), _drive_law(robot, effect, motion)
    levels = _constant(effect.joint_friction(robot, motion), robot.model.nv)
    offsets = _constant(effect.rotor_torque(robot, motion), robot.transmission.size)
    if law is not None:
        found.constant[:] += law[0]
        found.stiffness[:] += law[1]
        found.damping[:] += law[2]
    if drives is not None:
        found.gain[:] *= drives[0]
        found.delay[:] += drives[1]
    if levels is not None:
        found.friction[:] += levels
    if offsets is not None:
        found.offset[:] += offsets * robot.transmission.gear_ratio
    if law is None or levels is None or offsets is None or drives is None:
        yield effect.said()
    if "gear_efficiencies" in effect.acts_by:
        yield f"{effect.said()}: the exported gear loses nothing that grows with the load"
    if effect.acts_by & {"measured", "true", "measured_forces", "true_forces"}:
        yield f"{effect.said()}: it belongs to the sensors, so correct what they report"


def _probe_motion(robot: Robot) -> Motion:
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


def _joint_law(robot: Robot, effect: Effect, motion: Motion) -> FloatArray | None:
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


def _constant(values: FloatArray | None, size: int) -> FloatArray | None:
    """Return the one row (size,) of what a hook returned, zeros for nothing, None for several."""
    if values is None:
        return np.zeros(size)
    return values[0] if _equal(values, np.broadcast_to(values[0], values.shape)) else None


def _drive_law(robot: Robot, effect: Effect, motion: Motion) -> FloatArray | None:
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


def loss_numbers(robot: Robot) -> dict[str, Any]:
    """Return the numbers of a robot's losses for `wbc.export.losses`, lists of names and arrays.

    Torques and inertias of gears (m,) stand at their outputs. What these numbers do not hold is in
    `export_robot(robot, "mujoco").unsaid`.

    Raises:
        RobotError: a gear with losses is self-locking.
    """
    gears = robot.transmission
    locking = np.flatnonzero(gears.backward_efficiency <= 0.0)
    if locking.size:
        raise RobotError(
            f"the gear of '{gears.joints[locking[0]]}' is self-locking (backward efficiency <= 0): "
            "its friction has no level that the torque of the motor gives. Export with --to mjcf, "
            "or give the gear a backward efficiency above 0."
        )
    found, size = joint_numbers(robot, TOLD), gears.size
    forward, backward = gears.forward_efficiency, gears.backward_efficiency
    length, coefficient, speed = np.zeros(size), np.zeros(size), np.ones(size)
    for effect in robot.effects:
        if isinstance(effect, LoadPresliding):
            length[gears.index(effect.where)] = effect.length
        elif isinstance(effect, LoadStribeckFriction):
            k = gears.index(effect.where)
            coefficient[k], speed[k] = effect.coefficient, effect.speed
    numbers = {
        "joints": list(gears.joints),
        "motor_from_joint": gears.motor_from_joint,
        "joint_from_motor": np.linalg.inv(gears.motor_from_joint),
        "gain": found.gain,
        "offset": found.offset,
        "share": 0.5 * (forward + 1.0 / backward),
        "forward_efficiency": forward,
        "backward_efficiency": backward,
        "gear_length": length,
        "slow_coefficient": coefficient,
        "slow_speed": speed,
        "rotor_inertia": gears.reflected_inertia,
        "rotor_damping": found.motor_damping,
        "rotor_friction": found.motor_friction,
        "joint_damping": found.damping[robot.actuated],
        "joint_friction": found.friction[robot.actuated],
    }
    beside = (("bristle", Presliding, "length"), ("stribeck", StribeckFriction, "speed"))
    for name, kind, shape in beside:
        effects = [effect for effect in robot.effects if isinstance(effect, kind)]
        rows = [np.eye(size)[gears.index(effect.where)] for effect in effects]
        numbers[f"{name}_place"] = np.reshape(rows, (len(effects), size))
        for value in ("level", shape):
            numbers[f"{name}_{value}"] = np.array([effect.values[value] for effect in effects])
    return numbers
