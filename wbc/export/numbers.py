"""A robot in the words of other simulators: numbers per joint, and the losses of its gears.

What effects do at joints and in drives is read from the table that compiled steps evaluate. An
effect whose law has no number here is said in words, one of a user likewise.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from typing import Any

import numpy as np

from wbc import effects
from wbc.effects.tables import COULOMB, SPRING, VISCOUS, effect_table
from wbc.errors import RobotError
from wbc.robot import Robot

_AT_JOINTS = (effects.ViscousFriction, effects.CoulombFriction, effects.JointSpring)
_HELD = (*_AT_JOINTS, effects.TorqueConstant, effects.CurrentLimit, effects.TorqueOffset)
_KINDS = (effects.LoadPresliding, effects.Presliding, effects.StribeckFriction)
TOLD = ("transmission_efficiency", *(kind.name for kind in _KINDS))
"""Names of the effects that these numbers hold beside what stands in every exported file."""


class JointNumbers:
    """What simulators can be told about joints and motors, beside the links' inertias.

    Attributes:
        damping: (nv,) [N m s/rad].
        friction: (nv,) level of dry friction [N m].
        stiffness: (nv,) of springs beside the joints [N m/rad].
        constant: (nv,) torque of these springs at position zero [N m].
        motor_damping: (m,) viscous friction of each rotor, at the motor's output [N m s/rad].
        motor_friction: (m,) dry friction of each rotor, at the motor's output [N m].
        motor_limit: (m,) torque at the motor's output that can be asked for [N m], infinite where
            there is no limit.
        gain: (m,) delivered over reported torque.
        offset: (m,) delivered minus reported torque at the motor's output [N m].
        delay: (m,) [s].
        unsaid: sentences on what none of these numbers holds.
    """

    def __init__(self, robot: Robot, told: Container[str]) -> None:
        """Read the numbers of a robot with its effects.

        Args:
            told: names of effects that are told elsewhere, `transmission_efficiency` for what the
                gears lose under load.
        """
        gears, ratio = robot.transmission, np.abs(robot.transmission.gear_ratio)
        held = effect_table(robot.with_acting(e for e in robot.effects if isinstance(e, _HELD)))
        self.damping, self.friction, self.stiffness, self.constant = np.zeros((4, robot.model.nv))
        levels = {VISCOUS: self.damping, COULOMB: self.friction, SPRING: self.stiffness}
        for (law, _, row), (size, rest, _) in zip(held.joints, held.numbers, strict=True):
            levels[law][row] += size
            self.constant[row] += size * rest
        self.gain, limit, offset = held.drives.T
        self.motor_damping = ratio**2 * gears.rotor_viscous_friction
        self.motor_friction = ratio * gears.rotor_coulomb_friction
        self.motor_limit = ratio * np.minimum(gears.torque_limit, limit / self.gain)
        self.offset, self.delay = offset * gears.gear_ratio, np.zeros(gears.size)
        for effect in robot.effects:
            if isinstance(effect, effects.ActuationDelay):
                self.delay[gears.index(effect.where)] += effect.delay
        self.unsaid = tuple(dict.fromkeys(_unsaid(robot, told)))


def _unsaid(robot: Robot, told: Container[str]) -> Iterator[str]:
    """Yield what gears, contacts and effects do beside the numbers, and what is told elsewhere."""
    gears, losses_told = robot.transmission, "transmission_efficiency" in told
    for k, joint in enumerate(gears.joints):
        forward, backward = gears.forward_efficiency[k], gears.backward_efficiency[k]
        slow = gears.slow_loss[k]
        if not losses_told and (forward != 1.0 or backward != 1.0 or slow > 0.0):
            more = f", {slow:.3g} more near rest" if slow > 0.0 else ""
            shares = f"forward efficiency {forward:.3g}, backward efficiency {backward:.3g}{more}"
            lacks = "the exported gear loses nothing that grows with the load"
            yield f"losses in the gear at {joint} ({shares}): {lacks}"
        if np.isfinite(gears.stiffness[k]):
            spring = f"the spring in the gear at {joint} ({gears.stiffness[k]:.3g} N m/rad)"
            yield f"{spring}: the exported gear is rigid"
        if gears.backlash[k] > 0.0:
            yield f"the play in the gear at {joint} ({gears.backlash[k]:.3g} rad)"
    if robot.rotors_turn_with_links:
        yield "the rotors' reaction to the turning of their housings"
    for contact in robot.contacts:
        if (gain := contact.sensor_gain) != 1.0:
            yield f"the force sensor at {contact.name}, which reports {gain:.3g} times the force"
    for effect in robot.effects:
        acts, held = effect.acts_by - {"change"}, (*_HELD, effects.ActuationDelay)
        if acts and effect.name not in told and not isinstance(effect, held):
            way = ": it belongs to the sensors, so correct what they report"
            yield effect.said() + (way if acts & {"measured", "true"} else "")


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
        gear = f"the gear of '{gears.joints[locking[0]]}'"
        why = "its friction has no level that the torque of the motor gives"
        way = "Export with --to mjcf, or give the gear a backward efficiency above 0."
        raise RobotError(f"{gear} is self-locking (backward efficiency <= 0): {why}. {way}")
    found, size = JointNumbers(robot, TOLD), gears.size
    forward, backward = gears.forward_efficiency, gears.backward_efficiency
    lengths = {e.where: e.length for e in robot.effects if isinstance(e, effects.LoadPresliding)}
    numbers = {
        "joints": list(gears.joints),
        "motor_from_joint": gears.motor_from_joint,
        "joint_from_motor": np.linalg.inv(gears.motor_from_joint),
        "gain": found.gain,
        "offset": found.offset,
        "share": 0.5 * (forward + 1.0 / backward),
        "forward_efficiency": forward,
        "backward_efficiency": backward,
        "gear_length": np.array([lengths.get(joint, 0.0) for joint in gears.joints]),
        "slow_coefficient": gears.slow_loss,
        "slow_speed": gears.slow_speed,
        "rotor_inertia": gears.reflected_inertia,
        "rotor_damping": found.motor_damping,
        "rotor_friction": found.motor_friction,
        "joint_damping": found.damping[robot.actuated],
        "joint_friction": found.friction[robot.actuated],
    }
    bristles = ("bristle", effects.Presliding, "length")
    for name, kind, shape in (bristles, ("stribeck", effects.StribeckFriction, "speed")):
        own = [effect for effect in robot.effects if isinstance(effect, kind)]
        rows = [np.eye(size)[gears.index(effect.where)] for effect in own]
        numbers[f"{name}_place"] = np.reshape(rows, (len(own), size))
        for value in ("level", shape):
            numbers[f"{name}_{value}"] = np.array([effect.values[value] for effect in own])
    return numbers
