"""The residual of a robot on a set of records: what the model does not explain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import rotor_torque
from wbc.effects.soft_link import soft_deflections
from wbc.identification.record import Record
from wbc.robot import Effect, LinkResponse, Motion, Robot

_LEAST_GAIN = 0.2  # a drive model may not shrink the torque it is compared with below this share


def raw_residual(robot: Robot, record: Record, swinging: FloatArray | None = None) -> FloatArray:
    """Return (N, m + b) measured minus modelled, before weights and filters.

    The m driven joints come first (torque at the motor output, reported minus needed), then the b
    undriven coordinates (minus the wrench that nothing provides).

    Reported torque goes through the robot's drives forward, so that a drive that clips, sags or
    lags needs no inverse; the result is divided by what the drive's slope does to the size of the
    noise, or else a factor that shrinks everything would explain everything.

    Args:
        robot: with its effects.
        record: one log.
        swinging: what `swinging_torque` returned for a robot that differs little; None has links
            behind soft gears simulated again.
    """
    motion, links, contacts = _loads(robot, record, swinging)
    return _unexplained(robot, record, motion, links, contacts)


def swinging_torque(robot: Robot, record: Record) -> FloatArray | None:
    """Return what links that swing behind their gears need more (N, nv), None if none does."""
    if not any(deflects(effect) for effect in robot.effects):
        return None
    motion, links, contacts = _loads(robot, record, np.zeros_like(record.links))
    return _swinging(robot, record, motion, links, contacts)


def _loads(
    robot: Robot, record: Record, swinging: FloatArray | None
) -> tuple[Motion, FloatArray, FloatArray]:
    """Return the true motion, what the links then need, and what the contacts give."""
    motion = record.motion
    for effect in reversed(robot.effects):
        motion = effect.true(robot, motion)
    moved = record.along(motion)
    links, contacts = moved.links_of(robot), moved.contacts
    if swinging is None and any(deflects(effect) for effect in robot.effects):
        swinging = _swinging(robot, record, motion, links, contacts)
    if swinging is not None:
        links = links + swinging
    return motion, links, contacts


def deflects(effect: Effect | type[Effect]) -> bool:
    """Whether the link behind the effect's gear moves on its own, so that it must be simulated."""
    kind = effect if isinstance(effect, type) else type(effect)
    return kind.deflection is not Effect.deflection or kind.spring is not Effect.spring


def link_response(robot: Robot, record: Record, joint: str) -> LinkResponse:
    """Return how the link behind a gear of `robot` reacts, and what of the log it may explain."""
    motion, links, contacts = _loads(robot, record, None)
    left = _unexplained(robot, record, motion, links, contacts)
    return _response(robot, record, joint, motion, links - contacts, _on_joints(robot, left))


def _swinging(
    robot: Robot,
    record: Record,
    motion: Motion,
    links: FloatArray,
    contacts: FloatArray,
) -> FloatArray:
    """Return the torque (N, nv) of links that swing behind their gears.

    Links behind linear springs are simulated together. Every other link is driven by its motor
    and by the rest; with several, twice round.
    """
    springs = [effect for effect in robot.effects if effect.spring() is not None]
    loose = [effect for effect in robot.effects if deflects(effect) and effect not in springs]
    soft = {effect.where: effect for effect in springs}  # a gear is as soft as it was said last
    groups = [tuple(soft.values())] if soft else []
    groups += [(effect,) for effect in loose]
    torques = [np.zeros_like(links) for _ in groups]
    for k in (*range(len(groups)),) * (2 if len(groups) > 1 else 1):
        others = links + sum(torque for i, torque in enumerate(torques) if i != k)
        left = _on_joints(robot, _unexplained(robot, record, motion, others, contacts))
        load = others - contacts
        responses = [_response(robot, record, e.where, motion, load, left) for e in groups[k]]
        torques[k] = sum(_torques(robot, groups[k], responses), np.zeros_like(links))
    return np.asarray(sum(torques))


def _torques(
    robot: Robot, group: Sequence[Effect], responses: Sequence[LinkResponse]
) -> Iterator[FloatArray]:
    """Yield the torque (N, nv) of every link of a group that is simulated at once."""
    springs = [spring for effect in group if (spring := effect.spring()) is not None]
    bent: Sequence[FloatArray | None]
    if springs:
        bent = soft_deflections(responses, springs)
    else:
        bent = [e.deflection(robot, r) for e, r in zip(group, responses, strict=True)]
    for response, deflection in zip(responses, bent, strict=True):
        if deflection is not None:
            yield response.torque(deflection)


def _response(
    robot: Robot,
    record: Record,
    joint: str,
    motion: Motion,
    load: FloatArray,
    left: FloatArray,
) -> LinkResponse:
    response = record.along(motion).response_of(robot, joint)
    return replace(response, load=load, unexplained=left[:, response.row])


def _on_joints(robot: Robot, residual: FloatArray) -> FloatArray:
    """Return the residual of the driven joints (N, nv), as torque on the links' side."""
    gears = robot.transmission
    torque = np.zeros((len(residual), robot.model.nv))
    output = residual[:, : gears.size] * np.sign(gears.gear_ratio)
    torque[:, robot.actuated] = output @ gears.motor_from_joint
    return torque


def _unexplained(
    robot: Robot, record: Record, motion: Motion, links: FloatArray, contacts: FloatArray
) -> FloatArray:
    needed, wrench = rotor_torque(_without_drives(robot), motion, links, contacts)
    delivered, slope = _delivered(robot, motion, record.torque)
    share = record.reported_share
    size = np.sqrt(share * np.maximum(slope, _LEAST_GAIN) ** 2 + 1.0 - share)
    driven = (delivered - needed) / size * np.abs(robot.transmission.gear_ratio)
    return np.concatenate([driven, -wrench], axis=1)


def condensed_residual(
    robot: Robot,
    records: Sequence[Record],
    swinging: Sequence[FloatArray | None] | None = None,
) -> FloatArray:
    """Return weighted, low-passed and thinned residuals of all records, (rows, m + b)."""
    held = swinging or [None] * len(records)
    pairs = zip(records, held, strict=True)
    return np.concatenate([record.condense(raw_residual(robot, record, s)) for record, s in pairs])


def drive_gains(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (m,) the share of the reported torque that the drives of `robot` deliver."""
    return np.asarray(np.mean([_delivered(robot, r.motion, r.torque)[1] for r in records], axis=0))


def drive_misses(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (m,) rms of delivered minus needed torque, as a share of the needed torque's."""
    missing, needed = [], []
    size, passive = robot.transmission.size, robot.floating_size
    for record in records:
        motion, links, contacts = _loads(robot, record, None)
        need, _ = rotor_torque(_without_drives(robot), motion, links, contacts)
        delivered, _ = _delivered(robot, motion, record.torque)
        nothing = np.zeros((len(need), passive))
        missing.append(record.condense(np.concatenate([delivered - need, nothing], axis=1)))
        needed.append(record.condense(np.concatenate([need, nothing], axis=1)))
    left, right = (np.mean(np.concatenate(p)[:, :size] ** 2, axis=0) for p in (missing, needed))
    return np.asarray(np.sqrt(left / np.maximum(right, 1e-300)))


def _without_drives(robot: Robot) -> Robot:
    kept = tuple(e for e in robot.effects if not _drives(e))
    return robot if len(kept) == len(robot.effects) else replace(robot, effects=kept)


def _drives(effect: Effect) -> bool:
    return type(effect).drive is not Effect.drive


def _delivered(robot: Robot, motion: Motion, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    drives = [effect for effect in robot.effects if _drives(effect)]
    slope = np.ones(torque.shape[1])
    delivered = torque
    for effect in drives:
        before = delivered
        delivered = effect.drive(robot, motion, before)
        power = np.sum(before**2, axis=0)
        share = np.sum(before * delivered, axis=0) / np.where(power > 0.0, power, 1.0)
        slope = slope * np.where(power > 0.0, share, 1.0)
    return delivered, slope
