"""How well the torque that drives report follows the torque that the motion needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.records.record import Record
from wbc.identification.silent_drives import reported_torque

_FOLLOWS = 0.9  # correlation from which a report clearly follows a need
_LEAST_ROWS = 40
_LEAST_SHARE = 1e-4  # of a need's power that friction, inertia and offset leave to be compared


@dataclass(frozen=True, eq=False)
class Agreement:
    """Report against need of every driven joint in one log.

    What an offset, friction or a rotor could add is taken out of both: what is left is gravity
    and the inertia that changes with the pose, which no drive, gear or rotor imitates.

    Attributes:
        gain: (m,) reported over needed torque, by least squares; 0 where nothing can be compared.
        correlation: (m,) of the two; 0 where nothing can be compared.
    """

    gain: FloatArray
    correlation: FloatArray

    @property
    def clear(self) -> BoolArray:
        """(m,) whether the report follows the need, or its negative, beyond doubt."""
        return np.abs(self.correlation) > _FOLLOWS


def agreement(record: Record, residual: FloatArray) -> Agreement:
    """Return how the report of every joint follows its need.

    Args:
        record: one log.
        residual: (rows, m + b) condensed, reported minus needed [N m].
    """
    size = record.torque.shape[1]
    reported = reported_torque(record)
    needed = reported - residual
    others = _otherwise_caused(record)
    gain, correlation = np.zeros(size), np.zeros(size)
    for k in range(size) if record.rows >= _LEAST_ROWS else ():
        basis, _ = np.linalg.qr(others[:, :, k])
        report = reported[:, k] - basis @ (basis.T @ reported[:, k])
        need = needed[:, k] - basis @ (basis.T @ needed[:, k])
        power = float(need @ need)
        if power <= _LEAST_SHARE * float(needed[:, k] @ needed[:, k]):
            continue
        gain[k] = report @ need / power
        correlation[k] = report @ need / np.sqrt(power * max(float(report @ report), 1e-300))
    return Agreement(gain, correlation)


def _otherwise_caused(record: Record) -> FloatArray:
    """Return (rows, 4, m) normalised: offset, speed, direction and acceleration of each motor."""
    robot, motion = record.robot, record.motion
    size = robot.transmission.size
    lift = robot.transmission.motor_from_joint.T
    speed = motion.velocity[:, robot.actuated] @ lift
    acceleration = motion.acceleration[:, robot.actuated] @ lift  # type: ignore[index]
    values = np.zeros((*record.weight.shape, 4))
    for column, part in enumerate((1.0, speed, np.sign(speed), acceleration)):
        values[:, :size, column] = part
    condensed = record.condense(values)[:, :size].transpose(0, 2, 1)
    return np.asarray(condensed / np.maximum(np.linalg.norm(condensed, axis=0), 1e-300))
