"""A robot in the words of other simulators: numbers per joint, and what no such number says."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.export.probing import constant, drive_law, joint_law, probe_motion
from wbc.robot import Effect, Motion, Robot


@dataclass(frozen=True, eq=False)
class JointNumbers:
    """What simulators can be told about joints and motors, beside the links' inertias.

    Attributes:
        damping: (nv,) [N m s/rad].
        friction: (nv,) level of dry friction [N m].
        stiffness: (nv,) of springs beside the joints [N m/rad].
        constant: (nv,) torque of these springs at position zero [N m].
        motor_armature: (m,) inertia of each rotor at the motor's output [kg m^2].
        motor_damping: (m,) viscous friction of each rotor, at the motor's output [N m s/rad].
        motor_friction: (m,) dry friction of each rotor, at the motor's output [N m].
        motor_limit: (m,) torque at the motor's output [N m], infinite where there is none.
        motor_speed: (m,) limit at the motor's output [rad/s].
        gain: (m,) delivered over reported torque.
        offset: (m,) delivered minus reported torque at the motor's output [N m].
        delay: (m,) [s].
        unsaid: sentences on what none of these numbers holds.
    """

    damping: FloatArray
    friction: FloatArray
    stiffness: FloatArray
    constant: FloatArray
    motor_armature: FloatArray
    motor_damping: FloatArray
    motor_friction: FloatArray
    motor_limit: FloatArray
    motor_speed: FloatArray
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
        motor_armature=gears.reflected_inertia,
        motor_damping=ratio**2 * gears.rotor_viscous_friction,
        motor_friction=ratio * gears.rotor_coulomb_friction,
        motor_limit=ratio * gears.torque_limit,
        motor_speed=gears.speed_limit / ratio,
        gain=np.ones(gears.size),
        offset=np.zeros(gears.size),
        delay=np.zeros(gears.size),
        unsaid=tuple(_of_gears(robot, "transmission_efficiency" in told)),
    )
    effects, motion = (e for e in robot.effects if e.name not in told), probe_motion(robot)
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
    law, drives = joint_law(robot, effect, motion), drive_law(robot, effect, motion)
    levels = constant(effect.joint_friction(robot, motion), robot.model.nv)
    offsets = constant(effect.rotor_torque(robot, motion), robot.transmission.size)
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
