"""What links that swing behind soft or loose gears need beyond what their motors' motion says."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque, link_torque
from wbc.errors import DynamicsError
from wbc.identification.model.link_friction import LinkSide
from wbc.identification.model.yielding import yielding_gears
from wbc.identification.records.noise import without_noise
from wbc.identification.records.record import Record
from wbc.links import Deflections, LinkResponse, deflections
from wbc.robot import Motion, Robot
from wbc.transmission import Flanks

_SLACK = 1e-9  # [N m/rad] below which a spring holds nothing
_LARGEST = 0.4  # [rad] of deflection up to which what is not linear in it is followed
_ROUNDS, _ROUNDS_STRUCK = 8, 3  # a link that bounces is chaotic: more rounds do not settle it
_SETTLED, _SETTLED_STRUCK = 1e-3, 2e-2  # share of a deflection by which it may still change

Unexplained = Callable[[FloatArray], FloatArray]
"""Additional torque of the links (N, nv) -> what the log then leaves unexplained (N, nv)."""


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
    gears = yielding_gears(robot)
    struck = any(gear.play > 0.0 for gear in gears.values())
    rounds = _ROUNDS_STRUCK if struck else _ROUNDS
    rounds = 1 if straight or (struck and near is not None) else rounds
    settled = _SETTLED_STRUCK if struck else _SETTLED
    load = record.links_of(robot) - record.contacts_of(robot)
    links = [record.response_of(robot, joint) for joint in gears]
    rubbing = {joint: LinkSide.of(robot, joint, record.motion) for joint in gears}
    sides = {joint: side for joint, side in rubbing.items() if side is not None}
    beyond = np.zeros_like(load)

    def linear_at(bent: Deflections) -> tuple[FloatArray, dict[str, LinkSide]]:
        """Return what deflections add beyond their linear part, and the friction there."""
        moved = _moved(robot, record, gears, bent)
        there = {joint: side.at(robot, moved) for joint, side in sides.items()}
        return _needed(robot, record, moved) - load - _torque(links, bent), there

    if near is not None:
        beyond, sides = linear_at(near)
    bent, former = near, 0.0
    while True:
        known = beyond + _bends(load, sides.values())
        driving = _driving(robot, record, load + known, gears, sides)
        left = unexplained(known)
        plain = [replace(r, load=driving, unexplained=left[:, r.row]) for r in links]
        pairs = zip(gears, plain, strict=True)
        responses = [sides[joint].on(r) if joint in sides else r for joint, r in pairs]
        before = bent
        bent = deflections(responses, list(gears.values()), before, straight=straight)
        if not bent.finite:
            raise DynamicsError(_flown(gears))
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


def _flown(gears: Mapping[str, Flanks]) -> str:
    parts = [f"'{joint}' ({gear.stiffness:.3g} N m/rad)" for joint, gear in gears.items()]
    return (
        f"a link flies off behind the gear of {' or '.join(parts)} on these logs; such a gear "
        "cannot be what they show."
    )


def _torque(responses: Sequence[LinkResponse], bent: Deflections) -> FloatArray:
    """Return the torque (N, nv) of deflections, linear in them, with dry friction."""
    parts = zip(responses, bent.paths, strict=True)
    return np.asarray(sum(response.torque(path) for response, path in parts))


def _bends(load: FloatArray, sides: Iterable[LinkSide]) -> FloatArray:
    """Return what is not linear in smooth friction (N, nv) at the links."""
    bends = np.zeros_like(load)
    for side in sides:
        bends[:, side.row] += side.bend
    return bends


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
    acceleration = np.zeros_like(velocity)
    if motion.acceleration is not None:
        acceleration += motion.acceleration
    for joint, deflection in zip(joints, bent.paths, strict=True):
        row = robot.velocity_index(joint)
        position[:, robot.position_index(joint)] += deflection[:, 0]
        velocity[:, row] += deflection[:, 1]
        acceleration[:, row] += deflection[:, 2]
    return motion.replace(position=position, velocity=velocity, acceleration=acceleration)


def _needed(robot: Robot, record: Record, moved: Motion) -> FloatArray:
    """Return what the links need (N, nv) where they are, less what the contacts give."""
    return link_torque(robot, moved) - contact_torque(
        robot, moved.position, record.forces_of(robot)
    )
