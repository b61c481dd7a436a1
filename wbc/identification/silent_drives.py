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
# Standard deviations of the share, by which it must lie below `_SHARE`. The shares of the four
# drives of a recorded arm that report nothing are 0.01, 0.09, 0.02 and -0.04 +- 0.16; the least of
# the 31 others on eight recorded machines is 0.71 +- 0.06.
_DEVIATIONS = 2.0
_BLOCKS = 20  # of which what is left is taken to be independent


def silent_drives(
    records: Sequence[Record], residuals: Sequence[FloatArray], floor: FloatArray
) -> tuple[str, ...]:
    """Return the driven joints whose report is close to its noise and does not hold their need.

    Beside friction and an offset, which any joint may have, the report holds a share of what the
    motion needs. A drive that tells the truth has a share of 1, one with a wrong torque constant
    0.5 to 2, one that reports noise 0. Its size alone does not tell: on a recorded arm the current
    of a light wrist is noise as large as what the wrist needs. Nothing can be learnt about such a
    joint: any drive model that scales its report to nothing would explain it.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each: reported minus needed.
        floor: (m + b,) noise floor of the outputs.
    """
    robot = records[0].robot
    size = robot.transmission.size
    reported = [reported_torque(record)[:, :size] for record in records]
    needed = [own - left[:, :size] for own, left in zip(reported, residuals, strict=True)]
    friction = [_friction(record)[:, :, :size] for record in records]
    silent = records[0].reported.copy()
    for k in np.flatnonzero(silent):
        given = np.concatenate([own[:, k] for own in reported])
        columns = np.concatenate(
            [
                np.column_stack([need[:, k], rubs[:, :, k].T])
                for need, rubs in zip(needed, friction, strict=True)
            ]
        )
        given, columns = given - given.mean(), columns - columns.mean(axis=0)
        share, deviation = _share(given, columns)
        silent[k] = (
            abs(share) + _DEVIATIONS * deviation < _SHARE
            and abs(_correlation(given, columns[:, 0])) < _FOLLOWS
            and given.std() < _FLOORS * floor[k]
        )
    return tuple(n for n, yes in zip(robot.transmission.joints, silent, strict=True) if yes)


def _share(given: FloatArray, columns: FloatArray) -> tuple[float, float]:
    """Return how much of the first column a report holds beside the others.

    Args:
        given: (rows,) the report.
        columns: (rows, k) what the motion needs, then what friction would be.

    Returns:
        The share and its standard deviation by blocks of rows. Of a need that never changes the
        share is unknown.
    """
    size = np.sqrt(np.sum(columns**2, axis=0))
    if size[0] <= 0.0:
        return 0.0, np.inf
    columns = columns[:, size > 0.0]
    scaled = columns / size[size > 0.0]
    inverse = np.linalg.pinv(scaled.T @ scaled)
    solution = inverse @ (scaled.T @ given)
    left = given - scaled @ solution
    blocks = np.array_split(scaled * left[:, None], min(_BLOCKS, len(left)))
    sums = np.array([block.sum(axis=0) for block in blocks]) @ inverse[:, 0]
    return float(solution[0] / size[0]), float(np.linalg.norm(sums) / size[0])


def _correlation(one: FloatArray, other: FloatArray) -> float:
    return float(one @ other) / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-300)


def _friction(record: Record) -> FloatArray:
    """Return (2, rows, m + b) speed and direction of every gear, as the residual is condensed."""
    robot = record.robot
    turns = robot.transmission.motor_from_joint
    speed = np.zeros(record.weight.shape)
    speed[:, : len(turns)] = record.motion.velocity[:, robot.actuated] @ turns.T
    return np.stack([record.condense(speed), record.condense(np.sign(speed))])


def reported_torque(record: Record) -> FloatArray:
    """Return the condensed torque (rows, m + b) that the drives report, at the motor output."""
    torque = np.zeros(record.weight.shape)
    ratio = np.abs(record.robot.transmission.gear_ratio)
    torque[:, : ratio.size] = record.torque * ratio
    torque[:, output_count(record.robot) - len(record.robot.torque_sensors) :] = record.sensed
    return record.condense(torque)
