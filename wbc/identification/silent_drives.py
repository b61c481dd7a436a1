"""Drives whose reported torque has nothing to do with what their joint needs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.records.outputs import output_count
from wbc.identification.records.record import Record

_SHARE = 0.4  # of what the motion needs; a drive that reports less is not merely mis-scaled
_FOLLOWS = 0.7  # correlation with what the motion needs
_FLOORS = 20.0  # a report this far above its noise says something, whatever it is


def silent_drives(
    records: Sequence[Record], residuals: Sequence[FloatArray], floor: FloatArray
) -> tuple[str, ...]:
    """Return the driven joints whose report is small, noisy, and does not follow their need.

    Nothing can be learnt about such a joint: any drive model that scales its report to nothing
    would explain it.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each: reported minus needed.
        floor: (m + b,) noise floor of the outputs.
    """
    robot = records[0].robot
    size = robot.transmission.size
    needed = np.concatenate(residuals)[:, :size]
    reported = np.concatenate([reported_torque(record) for record in records])[:, :size]
    needed = reported - needed
    spread, need = reported.std(axis=0), needed.std(axis=0)
    joint = np.mean((reported - reported.mean(axis=0)) * (needed - needed.mean(axis=0)), axis=0)
    follows = np.abs(joint) / np.maximum(spread * need, 1e-300)
    known = records[0].reported
    silent = (spread < _SHARE * need) & (follows < _FOLLOWS) & (spread < _FLOORS * floor[:size])
    silent &= known
    if np.array_equal(silent, known):
        return ()
    return tuple(n for n, yes in zip(robot.transmission.joints, silent, strict=True) if yes)


def reported_torque(record: Record) -> FloatArray:
    """Return the condensed torque (rows, m + b) that the drives report, at the motor output."""
    torque = np.zeros(record.weight.shape)
    ratio = np.abs(record.robot.transmission.gear_ratio)
    torque[:, : ratio.size] = record.torque * ratio
    torque[:, output_count(record.robot) - len(record.robot.torque_sensors) :] = record.sensed
    return record.condense(torque)
