"""Links behind gears that yield: which effects make them, their friction, their motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque, link_torque
from wbc.effects.gear_losses import YieldingGear
from wbc.errors import DynamicsError
from wbc.identification.records.noise import without_noise
from wbc.identification.records.record import Record
from wbc.links import Deflections, LinkFriction, LinkResponse, deflections
from wbc.robot import Effect, Motion, Robot
from wbc.transmission import Flanks

_PLAY = 0.25  # of what flanks wind up by, below which they are a spring
_FASTER = 1e-5  # [rad/s]
_SAME = 1e-3
_SLACK = 1e-9  # [N m/rad] below which a spring holds nothing
_LARGEST = 0.4  # [rad] of deflection up to which what is not linear in it is followed
_ROUNDS, _ROUNDS_STRUCK = 8, 3  # a link that bounces is chaotic: more rounds do not settle it
_SETTLED, _SETTLED_STRUCK = 1e-3, 2e-2  # share of a deflection by which it may still change

Unexplained = Callable[[FloatArray], FloatArray]
"""Additional torque of the links (N, nv) -> what the log then leaves unexplained (N, nv)."""


def deflects(effect: Effect | type[Effect]) -> bool:
    """Whether the link behind the effect's gear moves on its own, so that it must be simulated."""
    return issubclass(effect if isinstance(effect, type) else type(effect), YieldingGear)


def some_deflect(effects: Iterable[Effect]) -> bool:
    """Whether a link behind one of the effects' gears must be simulated."""
    return any(deflects(effect) for effect in effects)


def loose(effects: Iterable[Effect]) -> bool:
    """Whether a link behind one of the effects' gears bounces."""
    return any(isinstance(effect, YieldingGear) and effect.has_play for effect in effects)


def plays(flanks: Flanks, load: float) -> bool:
    """Whether play counts beside what its flanks wind up by under a load [N m]."""
    return flanks.play * flanks.stiffness > _PLAY * load


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
    def of(cls, robot: Robot, effects: Sequence[Effect], row: int, motion: Motion) -> Rubbing:
        """Return the friction that `effects` make in a row of v, with derivatives."""
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
    return tuple(
        effect
        for effect in robot.effects
        if effect.where == joint
        and (
            "joint_friction" in effect.acts_by
            or np.any(Rubbing.of(robot, [effect], robot.velocity_index(joint), motion).slope)
        )
    )


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
        row: of the joint in v.
        effects: that rub.
        motor: the friction at the motor's speed.
        link: the friction where the link was last.
    """

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
        row = robot.velocity_index(joint)
        motor = Rubbing.of(robot, effects, row, motion)
        return cls(row, effects, motor, motor)

    def at(self, robot: Robot, motion: Motion) -> LinkSide:
        """Return the same friction of a link that moves like this."""
        return replace(self, link=Rubbing.of(robot, self.effects, self.row, motion))

    @property
    def bend(self) -> FloatArray:
        """(N,) smooth torque at the motor's speed by what is linear at the link's, less itself."""
        link, motor = self.link, self.motor
        there = link.smooth + link.slope * (motor.velocity - link.velocity)
        return np.asarray(there - motor.smooth)

    def differs(self, other: LinkSide) -> bool:
        """Whether friction at the link changed by more than a share of the largest."""
        now, then = self.link, other.link
        smooth = then.smooth + then.slope * (now.velocity - then.velocity)
        pairs = ((now.smooth, smooth), (now.level, then.level))
        return any(np.abs(a - b).max() > _SAME * np.abs(a).max() for a, b in pairs)

    def on(self, response: LinkResponse) -> LinkResponse:
        """Return the response of a link that rubs as well, its load with what is smooth of it."""
        damping = np.array(response.damping)
        damping[:, self.row] += self.link.slope
        friction = None
        if self.link.level.any() or self.motor.level.any():
            counted = self.motor.level * np.sign(self.motor.velocity)
            friction = LinkFriction(self.motor.velocity, self.link.level, counted)
        return replace(response, damping=damping, friction=friction)


@dataclass(frozen=True, eq=False)
class LinkSwing:
    """How links swing behind their gears along a log.

    Attributes:
        torque: (N, nv) that they need more.
        bent: their deflections.
    """

    torque: FloatArray
    bent: Deflections


def swing(
    robot: Robot,
    record: Record,
    unexplained: Unexplained,
    near: Deflections | None = None,
    *,
    straight: bool = False,
) -> LinkSwing:
    """Return how links swing behind their gears, all in one motion.

    Linear in the deflections at first; what their size adds (a hip that winds up by 0.03 rad needs
    some 3 % less inertia there) is then a load of its own, from the dynamics where the links are,
    until the next round promises to change no deflection by more than a share of the largest. So
    is what friction at the links adds, and how the log began is chosen anew beside dry friction.

    Args:
        robot: with its effects.
        record: along the true motion of its motors.
        unexplained: by which links choose how they moved when the log began.
        near: how they move with numbers close by; where they bounce one round from there does.
        straight: for derivatives: one round from `near`, as in `deflections`.

    Raises:
        DynamicsError: a link flies off, so that this robot explains nothing.
    """
    gears = {e.where: robot.transmission.flanks(e.where) for e in robot.effects if deflects(e)}
    struck = any(gear.play > 0.0 for gear in gears.values())
    rounds = _ROUNDS_STRUCK if struck else _ROUNDS
    rounds = 1 if straight or (struck and near is not None) else rounds
    settled = _SETTLED_STRUCK if struck else _SETTLED
    load = record.links_of(robot) - record.contacts_of(robot)
    links = [record.response_of(robot, joint) for joint in gears]
    rubbing = [(joint, LinkSide.of(robot, joint, record.motion)) for joint in gears]
    sides = {joint: side for joint, side in rubbing if side is not None}
    beyond = np.zeros_like(load)

    def linear_at(bent: Deflections) -> tuple[FloatArray, dict[str, LinkSide]]:
        """Return what deflections add beyond their linear part, and the friction there."""
        moved = _moved(robot, record, gears, bent)
        there = {joint: side.at(robot, moved) for joint, side in sides.items()}
        pushed = contact_torque(robot, moved.position, record.forces)
        return link_torque(robot, moved) - pushed - load - _torque(links, bent), there

    if near is not None:
        beyond, sides = linear_at(near)
    bent, former = near, 0.0
    while True:
        known = beyond.copy()
        for side in sides.values():
            known[:, side.row] += side.bend
        driving = _driving(robot, record, load + known, gears, sides)
        left = unexplained(known)
        plain = [replace(r, load=driving, unexplained=left[:, r.row]) for r in links]
        pairs = zip(gears, plain, strict=True)
        responses = [sides[joint].on(r) if joint in sides else r for joint, r in pairs]
        before = bent
        bent = deflections(responses, list(gears.values()), before, straight=straight)
        if not bent.finite:
            named = [f"'{joint}' ({g.stiffness:.3g} N m/rad)" for joint, g in gears.items()]
            raise DynamicsError(
                f"a link flies off behind the gear of {' or '.join(named)} on these logs; such a "
                "gear cannot be what they show."
            )
        torque = known + _torque(responses, bent)
        rounds -= 1
        if not rounds or not bent.largest < _LARGEST:
            break
        change = bent.largest if before is None else bent.change(before)
        # What is not linear in a deflection is at first the square of it in radians.
        promised = change * (change / former if former else bent.largest)
        beyond, there = linear_at(bent)
        differs = any(side.differs(sides[joint]) for joint, side in there.items())
        if promised < settled * bent.largest and not differs:
            break
        former, sides = change, there
    return LinkSwing(torque, bent)


def _torque(responses: Sequence[LinkResponse], bent: Deflections) -> FloatArray:
    """Return the torque (N, nv) of deflections, linear in them, with dry friction."""
    parts = zip(responses, bent.paths, strict=True)
    return np.asarray(sum(response.torque(path) for response, path in parts))


def _driving(
    robot: Robot,
    record: Record,
    load: FloatArray,
    gears: Mapping[str, Flanks],
    sides: Mapping[str, LinkSide],
) -> FloatArray:
    """Return a load (N, nv) with what is smooth in the friction at the links, less its noise."""
    driving = np.array(load)
    for side in sides.values():
        driving[:, side.row] += side.motor.smooth
    for joint, gear in gears.items():
        if gear.play == 0.0:
            response = record.response_of(robot, joint)
            inertia = float(np.mean(response.inertia[:, response.row]))
            frequency = float(np.sqrt(max(gear.stiffness, _SLACK) / inertia))
            driving = without_noise(record, driving, joint, frequency)
    return driving


def _moved(robot: Robot, record: Record, joints: Iterable[str], bent: Deflections) -> Motion:
    """Return the motion of the links."""
    motion = record.motion
    position, velocity = np.array(motion.position), np.array(motion.velocity)
    acceleration = np.array(motion.acceleration)
    for joint, deflection in zip(joints, bent.paths, strict=True):
        row = robot.velocity_index(joint)
        position[:, robot.position_index(joint)] += deflection[:, 0]
        velocity[:, row] += deflection[:, 1]
        acceleration[:, row] += deflection[:, 2]
    return motion.replace(position=position, velocity=velocity, acceleration=acceleration)
