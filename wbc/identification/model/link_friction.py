"""Friction of a joint whose gear lets the link stray: at the link's speed, or at the motor's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.links import LinkFriction, LinkResponse
from wbc.robot import Effect, Motion, Robot

_FASTER = 1e-5  # [rad/s]
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class Rubbing:
    """Friction of one joint along a motion.

    Attributes:
        velocity: (N,) of the joint [rad/s].
        smooth: (N,) torque that must overcome what is smooth (viscous, drag) [N m].
        slope: (N,) its derivative by the velocity [N m s/rad].
        level: (N,) of what is dry [N m].
    """

    velocity: FloatArray
    smooth: FloatArray
    slope: FloatArray
    level: FloatArray

    @classmethod
    def of(cls, robot: Robot, effects: Sequence[Effect], joint: str, motion: Motion) -> Rubbing:
        """Return the friction that `effects` make at a joint, with derivatives along a motion."""
        row = robot.velocity_index(joint)
        velocity = np.asarray(motion.velocity[:, row])
        faster = motion.replace(velocity=motion.velocity + _FASTER * np.eye(robot.model.nv)[row])
        smooth, after, level = np.zeros((3, len(velocity)))
        for effect in effects:
            pushed, then = (effect.joint_torque(robot, m) for m in (motion, faster))
            if pushed is not None and then is not None:
                smooth, after = smooth - pushed[:, row], after - then[:, row]
            dry = effect.joint_friction(robot, motion)
            if dry is not None:
                level = level + dry[:, row]
        return cls(velocity, smooth, (after - smooth) / _FASTER, level)


def rubbing_effects(robot: Robot, joint: str, motion: Motion) -> tuple[Effect, ...]:
    """Return the effects of a robot at a joint whose torque depends on the joint's speed."""
    found = []
    for effect in robot.effects:
        if effect.where != joint or not effect.acts_by & {"joint_torque", "joint_friction"}:
            continue
        if "joint_friction" in effect.acts_by or np.any(
            Rubbing.of(robot, [effect], joint, motion).slope
        ):
            found.append(effect)
    return tuple(found)


def rubbing_at_link(robot: Robot, joint: str, motion: Motion) -> tuple[Effect, ...]:
    """Return the effects of a robot that rub at the link behind a gear that yields."""
    gears = (e for e in robot.effects if isinstance(e, YieldingGear) and e.where == joint)
    if any(gear.friction_side == "motor" for gear in gears):
        return ()
    return rubbing_effects(robot, joint, motion)


@dataclass(frozen=True, eq=False)
class LinkSide:
    """Friction of one joint at its link: made linear where the link is thought to be.

    Attributes:
        joint: name.
        row: of the joint in v.
        effects: that rub.
        motor: the friction at the motor's speed.
        link: the friction where the link was last.
    """

    joint: str
    row: int
    effects: tuple[Effect, ...]
    motor: Rubbing
    link: Rubbing

    @classmethod
    def of(cls, robot: Robot, joint: str, motion: Motion) -> LinkSide | None:
        """Return the friction at a link that moves as its motor, None if nothing rubs there."""
        effects = rubbing_at_link(robot, joint, motion)
        if not effects:
            return None
        motor = Rubbing.of(robot, effects, joint, motion)
        return cls(joint, robot.velocity_index(joint), effects, motor, motor)

    def at(self, robot: Robot, motion: Motion) -> LinkSide:
        """Return the same friction of a link that moves like this."""
        return replace(self, link=Rubbing.of(robot, self.effects, self.joint, motion))

    @property
    def bend(self) -> FloatArray:
        """(N,) smooth torque at the motor's speed by what is linear at the link's, less itself."""
        link, motor = self.link, self.motor
        there = link.smooth + link.slope * (motor.velocity - link.velocity)
        return np.asarray(there - motor.smooth)

    def differs(self, other: LinkSide) -> bool:
        """Whether friction at the link changed by more than a share of the largest."""
        for name in ("smooth", "level"):
            one, before = getattr(self.link, name), getattr(other.link, name)
            if name == "smooth":
                before = before + other.link.slope * (self.link.velocity - other.link.velocity)
            if np.abs(one - before).max() > _SAME * np.abs(one).max():
                return True
        return False

    def on(self, response: LinkResponse) -> LinkResponse:
        """Return the response of a link that rubs as well, its load with what is smooth of it."""
        damping = np.array(response.damping)
        damping[:, self.row] += self.link.slope
        friction = None
        if self.link.level.any() or self.motor.level.any():
            counted = self.motor.level * np.sign(self.motor.velocity)
            friction = LinkFriction(self.motor.velocity, self.link.level, counted)
        return replace(response, damping=damping, friction=friction)
