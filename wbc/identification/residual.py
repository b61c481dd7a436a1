"""The residual of a robot on a set of records: what the model does not explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import rotor_torque
from wbc.identification.record import Record
from wbc.robot import Effect, Motion, Robot

_LEAST_GAIN = 0.2  # a drive model may not shrink the torque it is compared with below this share


def raw_residual(robot: Robot, record: Record) -> FloatArray:
    """Return (N, m + b) measured minus modelled, before weights and filters.

    The m driven joints come first (torque at the motor output, reported minus needed), then the b
    undriven coordinates (minus the wrench that nothing provides).

    Reported torque goes through the robot's drives forward, so that a drive that clips, sags or
    lags needs no inverse; the result is divided by what the drive's slope does to the size of the
    noise, or else a factor that shrinks everything would explain everything.
    """
    motion = record.motion
    for effect in reversed(robot.effects):
        motion = effect.true(robot, motion)
    links = record.links_of(robot, motion)
    contacts = record.contacts_along(motion)
    for effect in robot.effects:
        if type(effect).deflection is not Effect.deflection:
            response = replace(record.response(effect.where), load=links - contacts)
            bent = effect.deflection(robot, response)
            if bent is not None:
                links = links + response.torque(bent)
    needed, wrench = rotor_torque(_without_drives(robot), motion, links, contacts)
    delivered, slope = _delivered(robot, motion, record.torque)
    share = record.reported_share
    size = np.sqrt(share * slope**2 + 1.0 - share)
    driven = (delivered - needed) / size * np.abs(robot.transmission.gear_ratio)
    return np.concatenate([driven, -wrench], axis=1)


def condensed_residual(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return weighted, low-passed and thinned residuals of all records, (rows, m + b)."""
    return np.concatenate([record.condense(raw_residual(robot, record)) for record in records])


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
    return delivered, np.maximum(slope, _LEAST_GAIN)
