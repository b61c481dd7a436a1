"""What links that swing behind soft or loose gears need beyond what their motors' motion says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque, link_torque
from wbc.effects.soft_link import soft_deflections
from wbc.identification.record import Record
from wbc.robot import Effect, LinkResponse, Robot

_LARGEST = 0.4  # [rad] of deflection up to which what is not linear in it is followed
_ROUNDS = 8
_SETTLED = 1e-3

Unexplained = Callable[[FloatArray], FloatArray]
"""Additional torque of the links (N, nv) -> what the log then leaves unexplained (N, nv)."""


def deflects(effect: Effect | type[Effect]) -> bool:
    """Whether the link behind the effect's gear moves on its own, so that it must be simulated."""
    kind = effect if isinstance(effect, type) else type(effect)
    return kind.deflection is not Effect.deflection or kind.spring is not Effect.spring


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
    # A gear is as soft as it was said last.
    springs = {e.where: spring for e in robot.effects if (spring := e.spring()) is not None}
    loose = [e for e in robot.effects if deflects(e) and e.spring() is None]
    groups: list[Effect | None] = [None] if springs else []
    groups += loose
    torques = [np.zeros_like(load) for _ in groups]
    for k in (*range(len(groups)),) * (2 if len(groups) > 1 else 1):
        others = sum((t for i, t in enumerate(torques) if i != k), np.zeros_like(load))
        effect = groups[k]
        if effect is None:
            torques[k] = _soft(robot, record, springs, load, others, unexplained)
            continue
        response = driven(robot, record, effect.where, load + others, unexplained(others))
        bent = effect.deflection(robot, response)
        torques[k] = np.zeros_like(load) if bent is None else response.torque(bent)
    return sum(torques, np.zeros_like(load))


def driven(
    robot: Robot, record: Record, joint: str, load: FloatArray, left: FloatArray
) -> LinkResponse:
    """Return the response of a link under a load (N, nv) that leaves (N, nv) unexplained."""
    response = record.response_of(robot, joint)
    return replace(response, load=load, unexplained=left[:, response.row])


def _soft(
    robot: Robot,
    record: Record,
    springs: dict[str, tuple[float, float]],
    load: FloatArray,
    others: FloatArray,
    unexplained: Unexplained,
) -> FloatArray:
    """Return the torque of all links behind springs.

    Linear in the deflections at first; what their size adds (a hip that winds up by 0.03 rad needs
    some 3 % less inertia there) is then a load of its own, from the dynamics where the links are,
    until the next round promises to change no deflection by more than a share of the largest.
    """
    beyond = np.zeros_like(load)
    straight = np.zeros_like(load)
    bent = [np.zeros((len(load), 3)) for _ in springs]
    former = 0.0
    for _ in range(_ROUNDS):
        known = others + beyond
        left = unexplained(known)
        responses = [driven(robot, record, joint, load + known, left) for joint in springs]
        before, bent = bent, soft_deflections(responses, list(springs.values()))
        straight = sum(
            (r.torque(d) for r, d in zip(responses, bent, strict=True)), np.zeros_like(load)
        )
        largest = max(float(np.abs(d[:, 0]).max()) for d in bent)
        change = max(float(np.abs(d - b)[:, 0].max()) for d, b in zip(bent, before, strict=True))
        if change**2 < _SETTLED * largest * former or not largest < _LARGEST:
            break
        former = change
        beyond = _needed(robot, record, list(springs), bent) - load - straight
    return np.asarray(straight + beyond)


def _needed(
    robot: Robot, record: Record, joints: Sequence[str], bent: Sequence[FloatArray]
) -> FloatArray:
    """Return what the links need (N, nv) where they are, less what the contacts give."""
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
    moved = motion.replace(position=position, velocity=velocity, acceleration=acceleration)
    return link_torque(robot, moved) - contact_torque(robot, position, record.forces)
