"""What links that swing behind soft or loose gears need beyond what their motors' motion says."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque, link_torque
from wbc.effects.rubbing_link import rubbing_deflections, rubbing_start
from wbc.effects.soft_link import Spring, own_frequency, soft_deflections
from wbc.effects.striking_links import struck_deflections
from wbc.effects.yielding_gear import YieldingGear
from wbc.identification.model.link_friction import LinkSide
from wbc.identification.model.yielding import loose, strike_together
from wbc.identification.records.load_noise import without_noise
from wbc.identification.records.record import Record
from wbc.robot import Effect, LinkResponse, Motion, Robot

_LARGEST = 0.4  # [rad] of deflection up to which what is not linear in it is followed
_ROUNDS = 8
_SETTLED = 1e-3
_STRIKES = 3  # rounds in which links that strike are followed where they are ...
_STRAIGHT = 0.02  # [rad] ... if they bend farther, or rub
_STARTS = 3  # rounds in which the beginning of a link with dry friction is chosen

Unexplained = Callable[[FloatArray], FloatArray]
"""Additional torque of the links (N, nv) -> what the log then leaves unexplained (N, nv)."""


def swing(robot: Robot, record: Record, unexplained: Unexplained) -> FloatArray:
    """Return the torque (N, nv) of links that swing behind their gears.

    Links behind linear springs are simulated together. Every other link is driven by its motor
    and by the rest; with several, twice round.

    Args:
        robot: with its effects.
        record: along the true motion of its motors.
        unexplained: by which links choose how they moved when the log began.
    """
    load = record.links_of(robot) - record.contacts
    if strike_together(robot.effects):
        return _struck(robot, record, load, unexplained)
    # A gear is as soft as it was said last.
    springs = {e.where: spring for e in robot.effects if (spring := e.spring()) is not None}
    bouncing = [e for e in robot.effects if loose([e])]
    rubbing = _rubbing(robot, record, {*springs, *(e.where for e in bouncing)})
    groups: list[Effect | None] = [None] if springs else []
    groups += bouncing
    torques = [np.zeros_like(load) for _ in groups]
    for k in (*range(len(groups)),) * (2 if len(groups) > 1 else 1):
        others = sum((t for i, t in enumerate(torques) if i != k), np.zeros_like(load))
        effect = groups[k]
        if effect is None:
            torques[k] = _soft(robot, record, springs, rubbing, load, others, unexplained)
        else:
            # Friction behind two gears in series loads one of them.
            side = None if effect.where in springs else rubbing.get(effect.where)
            torques[k] = _loose(robot, record, effect, side, load, others, unexplained)
    return sum(torques, np.zeros_like(load))


def _struck(robot: Robot, record: Record, load: FloatArray, unexplained: Unexplained) -> FloatArray:
    """Return the torque of links that strike their flanks and so throw one another."""
    gears = [effect for effect in robot.effects if isinstance(effect, YieldingGear)]
    joints, contacts = [gear.where for gear in gears], [gear.contact() for gear in gears]
    sides = _rubbing(robot, record, joints)
    beyond, torque = np.zeros_like(load), np.zeros_like(load)
    for k in range(_STRIKES):
        bends = _bends(load, sides.values())
        known = beyond + bends
        driving, left = _driving(load + known, sides.values()), unexplained(known)
        plain = [driven(robot, record, joint, driving, left) for joint in joints]
        responses = _with_friction(joints, plain, sides)
        bent = struck_deflections(responses, contacts)
        torque = known + sum(r.torque(d) for r, d in zip(responses, bent, strict=True))
        largest = max(float(np.abs(d[:, 0]).max()) for d in bent)
        if (not sides and largest < _STRAIGHT) or not largest < _LARGEST:
            break
        moved, before = _moved(robot, record, joints, bent), sides
        beyond = _needed(robot, record, moved) - load
        beyond -= sum((r.torque(d) for r, d in zip(plain, bent, strict=True)), np.zeros_like(load))
        sides = {joint: side.at(robot, moved) for joint, side in sides.items()}
        if k and not any(side.differs(before[joint]) for joint, side in sides.items()):
            break
    return torque


def _rubbing(robot: Robot, record: Record, joints: Iterable[str]) -> dict[str, LinkSide]:
    """Return the friction that rubs at links, where the links are at their motors."""
    sides = {joint: LinkSide.of(robot, joint, record.motion) for joint in joints}
    return {joint: side for joint, side in sides.items() if side is not None}


def _loose(
    robot: Robot,
    record: Record,
    effect: Effect,
    side: LinkSide | None,
    load: FloatArray,
    others: FloatArray,
    unexplained: Unexplained,
) -> FloatArray:
    """Return the torque of a link that its gear leaves free to bounce."""
    joint = effect.where
    for _ in range(_ROUNDS):
        rubbing = [] if side is None else [side]
        known = others + _bends(load, rubbing)
        driving = _driving(load + known, rubbing)
        response = driven(robot, record, joint, driving, unexplained(known), side)
        bent = effect.deflection(robot, response)
        if bent is None:
            return np.zeros_like(load)
        torque = known - others + response.torque(bent)
        if side is None:
            break
        before = side
        side = side.at(robot, _moved(robot, record, [joint], [bent]))
        if not side.differs(before):
            break
    return torque


def _bends(load: FloatArray, sides: Iterable[LinkSide]) -> FloatArray:
    """Return what is not linear in smooth friction (N, nv) at the links."""
    bends = np.zeros_like(load)
    for side in sides:
        bends[:, side.row] += side.bend
    return bends


def driven(
    robot: Robot,
    record: Record,
    joint: str,
    load: FloatArray,
    left: FloatArray,
    side: LinkSide | None = None,
) -> LinkResponse:
    """Return the response of a link under a load (N, nv) that leaves (N, nv) unexplained."""
    response = record.response_of(robot, joint)
    response = replace(response, load=load, unexplained=left[:, response.row])
    return response if side is None else side.on(response)


def _soft(
    robot: Robot,
    record: Record,
    springs: Mapping[str, Spring],
    rubbing: Mapping[str, LinkSide],
    load: FloatArray,
    others: FloatArray,
    unexplained: Unexplained,
) -> FloatArray:
    """Return the torque of all links behind springs.

    Linear in the deflections at first; what their size adds (a hip that winds up by 0.03 rad needs
    some 3 % less inertia there) is then a load of its own, from the dynamics where the links are,
    until the next round promises to change no deflection by more than a share of the largest. So
    is what friction at the links adds, and how the log began is chosen anew beside dry friction.
    """
    joints, pairs = list(springs), list(springs.values())
    sides = {joint: side for joint, side in rubbing.items() if joint in springs}
    beyond = np.zeros_like(load)
    straight = np.zeros_like(load)
    bent = [np.zeros((len(load), 3)) for _ in joints]
    former = 0.0
    start: FloatArray | None = None
    for k in range(_ROUNDS):
        bends = _bends(load, sides.values())
        known = others + beyond + bends
        left = unexplained(known)
        driving = _driving(load + known, sides.values())
        for joint, spring in springs.items():
            frequency = own_frequency(record.response_of(robot, joint), spring)
            driving = without_noise(record, driving, joint, frequency)
        plain = [driven(robot, record, joint, driving, left) for joint in joints]
        responses = _with_friction(joints, plain, sides)
        before = bent
        if any(response.friction is not None for response in responses):
            start = rubbing_start(responses, pairs) if start is None else start
            bent, better = rubbing_deflections(responses, pairs, start)
            start = better if k < _STARTS else start
        else:
            bent = soft_deflections(responses, pairs)
        straight = bends + sum(
            (r.torque(d) for r, d in zip(responses, bent, strict=True)), np.zeros_like(load)
        )
        largest = max(float(np.abs(d[:, 0]).max()) for d in bent)
        change = max(
            float(np.abs(d[:, 0] - b[:, 0]).max()) for d, b in zip(bent, before, strict=True)
        )
        if change**2 < _SETTLED * largest * former or not largest < _LARGEST:
            break
        former = change
        moved = _moved(robot, record, joints, bent)
        beyond = _needed(robot, record, moved) - load
        beyond -= sum((r.torque(d) for r, d in zip(plain, bent, strict=True)), np.zeros_like(load))
        sides = {joint: side.at(robot, moved) for joint, side in sides.items()}
    return np.asarray(straight + beyond)


def _driving(load: FloatArray, sides: Iterable[LinkSide]) -> FloatArray:
    """Return a load (N, nv) with what is smooth in the friction at the links."""
    driving = np.array(load)
    for side in sides:
        driving[:, side.row] += side.motor.smooth
    return driving


def _with_friction(
    joints: Sequence[str], plain: Sequence[LinkResponse], sides: Mapping[str, LinkSide]
) -> list[LinkResponse]:
    """Return the responses of links at some of which friction rubs."""
    pairs = zip(joints, plain, strict=True)
    return [sides[joint].on(r) if joint in sides else r for joint, r in pairs]


def _moved(
    robot: Robot, record: Record, joints: Sequence[str], bent: Sequence[FloatArray]
) -> Motion:
    """Return the motion of the links."""
    motion = record.motion
    position, velocity = np.array(motion.position), np.array(motion.velocity)
    acceleration = np.zeros_like(velocity)
    if motion.acceleration is not None:
        acceleration += motion.acceleration
    for joint, deflection in zip(joints, bent, strict=True):
        row = robot.velocity_index(joint)
        position[:, robot.position_index(joint)] += deflection[:, 0]
        velocity[:, row] += deflection[:, 1]
        acceleration[:, row] += deflection[:, 2]
    return motion.replace(position=position, velocity=velocity, acceleration=acceleration)


def _needed(robot: Robot, record: Record, moved: Motion) -> FloatArray:
    """Return what the links need (N, nv) where they are, less what the contacts give."""
    return link_torque(robot, moved) - contact_torque(robot, moved.position, record.forces)
