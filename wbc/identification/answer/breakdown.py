"""Where a residual is large: by the variables that physical effects depend on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.records.outputs import output_gear, output_names, output_row
from wbc.identification.records.record import Record
from wbc.robot.coordinates import unit_at

_BINS = 12


@dataclass(frozen=True, eq=False)
class Breakdown:
    """The residual of one output over one variable, in bins of equal count.

    Attributes:
        output: joint or coordinate.
        variable: for example `speed`, `load`, `position`.
        unit: of the variable.
        center: (k,) mean of the variable in each bin.
        mean: (k,) mean residual [N m, N].
        rms: (k,) root mean square residual.
        share: how much of the residual's variance the bin means explain, 0 to 1.
    """

    output: str
    variable: str
    unit: str
    center: FloatArray
    mean: FloatArray
    rms: FloatArray
    share: float


def breakdowns(records: Sequence[Record], residuals: Sequence[FloatArray]) -> list[Breakdown]:
    """Return every output's residual over every variable known, strongest share first.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each.
    """
    found = []
    robot = records[0].robot
    outputs = output_names(robot)
    stacked = np.concatenate(residuals)
    for column, output in enumerate(outputs):
        for variable, unit, values in _variables(records, column):
            if np.ptp(values) > 0.0:
                stated = unit_at(robot, output, unit)
                found.append(binned(output, variable, stated, values, stacked[:, column]))
    return sorted(found, key=lambda b: -b.share)


def binned(
    output: str, variable: str, unit: str, values: FloatArray, residual: FloatArray
) -> Breakdown:
    """Return the residual (rows,) of an output over a variable (rows,), in bins of equal count."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1)))
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(index, minlength=len(edges) - 1), 1)
    mean = np.bincount(index, residual, minlength=len(edges) - 1) / count
    power = np.bincount(index, residual**2, minlength=len(edges) - 1) / count
    center = np.bincount(index, values, minlength=len(edges) - 1) / count
    total = float(np.mean(residual**2))
    share = float(np.sum(count * mean**2) / count.sum() / total) if total > 0.0 else 0.0
    return Breakdown(output, variable, unit, center, mean, np.sqrt(power), share)


def _variables(records: Sequence[Record], column: int) -> list[tuple[str, str, FloatArray]]:
    """Return (name, unit, values (rows,)) for one output."""
    robot = records[0].robot
    row, gear = output_row(robot, column), output_gear(robot, column)
    speed = _rows(records, lambda r: r.motion.velocity[:, row])
    acceleration = _rows(records, lambda r: _accelerations(r)[:, row])
    load = _rows(records, lambda r: r.load[:, row])
    found = [
        ("speed", "rad/s", speed),
        ("acceleration", "rad/s^2", acceleration),
        ("load", "N m", load),
        ("time", "s", np.concatenate([record.time for record in records])),
    ]
    if gear is not None:
        position = _rows(records, lambda r: r.motion.position[:, robot.actuated_position[gear]])
        ratio = float(robot.transmission.gear_ratio[gear])
        found += [
            ("position", "rad", position),
            ("rotor angle", "rad", np.mod(position * ratio, 2.0 * np.pi)),
            ("mesh power", "W", load * speed),
            ("direction", "1", np.sign(speed)),
            ("load against direction", "N m", np.abs(load) * np.sign(speed)),
            ("time since reversal", "s", np.concatenate([_since(r, row) for r in records])),
        ]
        if all(record.motion.temperature is not None for record in records):
            found.append(
                ("temperature", "deg C", _rows(records, lambda r: _temperatures(r)[:, gear]))
            )
    for name in records[0].forces:
        force = [record.thinned(np.linalg.norm(record.forces[name], axis=1)) for record in records]
        found.append((f"force at {name}", "N", np.concatenate(force)))
    return found


def _rows(records: Sequence[Record], read: Callable[[Record], FloatArray]) -> FloatArray:
    return np.concatenate([record.thinned(read(record)) for record in records])


def _accelerations(record: Record) -> FloatArray:
    values = record.motion.acceleration
    return np.zeros_like(record.motion.velocity) if values is None else values


def _temperatures(record: Record) -> FloatArray:
    values = record.motion.temperature
    return np.zeros_like(record.torque) if values is None else values


def _since(record: Record, row: int) -> FloatArray:
    """Return the time since the joint last changed direction, (rows,) [s]."""
    sign = np.sign(record.motion.velocity[:, row])
    changed = np.flatnonzero(np.diff(sign) != 0.0) + 1
    index = np.arange(len(sign))
    last = np.zeros(len(sign))
    last[changed] = changed
    return record.thinned((index - np.maximum.accumulate(last)) / record.rate)
