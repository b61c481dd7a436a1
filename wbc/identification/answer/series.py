"""Torques of logs over time, measured and modelled, in the band of the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wbc.arrays import FloatArray
from wbc.identification.model.residual import condensed_residual, raw_residual
from wbc.identification.records.record import Record
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class Series:
    """One log's torques over time, in the band of the residual.

    Attributes:
        name: of the log.
        time: (rows,) [s].
        measured: (rows, m) reported torque at the motor output [N m].
        residual: (rows, m + b) measured minus modelled [N m, N], weighted: near a reversal it
            counts for nothing.
        modelled: (rows, m) torque that the model needs for the motion [N m], not weighted.
    """

    name: str
    time: FloatArray
    measured: FloatArray
    residual: FloatArray
    modelled: FloatArray


def series_of(robot: Robot, records: Sequence[Record]) -> tuple[Series, ...]:
    """Return the torques that `robot` needs on logs beside those that were reported.

    Args:
        robot: with its effects.
        records: of logs, one or more.
    """
    return tuple(_series(robot, record) for record in records)


def _series(robot: Robot, record: Record) -> Series:
    gears = robot.transmission
    measured = record.condense_driven(record.torque) * abs(gears.gear_ratio)
    unexplained = record.condense_driven(raw_residual(robot, record)[:, : gears.size])
    residual = condensed_residual(robot, [record])
    return Series(record.name, record.time, measured, residual, measured - unexplained)
