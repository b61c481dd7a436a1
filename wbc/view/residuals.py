"""Residuals of a robot before and after a diagnosis, with what they may depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.record import Record
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.robot.coordinates import coordinate_names

_HALF = 0.5


@dataclass(frozen=True, eq=False)
class ResidualRun:
    """One log: residuals and what to plot them over, all (rows, outputs).

    Attributes:
        name: of the log.
        time: (rows,) [s].
        before: measured minus modelled of the robot that was given [N m, N].
        after: the same of the robot with the effects found.
        position: of the joint [rad, m].
        speed: of the joint [rad/s, m/s].
        load: measured torque at the motor output [N m]; NaN for undriven coordinates.
        unused: per output, starts and ends (k, 2) [s] of the stretches that count less than half,
            as near a reversal of motion.
    """

    name: str
    time: FloatArray
    before: FloatArray
    after: FloatArray
    position: FloatArray
    speed: FloatArray
    load: FloatArray
    unused: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class LogResiduals:
    """Residuals of several logs of one robot.

    Attributes:
        outputs: names, driven joints first, then undriven coordinates.
        units: "N m" or "N" of each output.
        driven: how many outputs are driven joints.
        floor: (outputs,) root mean square that noise alone leaves.
        floor_source: `repeats` or `lower bound`.
        runs: one per log.
    """

    outputs: tuple[str, ...]
    units: tuple[str, ...]
    driven: int
    floor: FloatArray
    floor_source: str
    runs: tuple[ResidualRun, ...]


def residuals_of(robot: Robot, fitted: Robot, logs: Sequence[Log]) -> LogResiduals:
    """Return the residuals of `robot` and of `fitted`, the same robot with effects, on logs.

    Raises:
        IdentificationError: logs that cannot be compared with this robot.
        LogError: a channel is missing.
    """
    return residuals_in(EstimationProblem.from_logs(robot, logs), fitted)


def residuals_in(problem: EstimationProblem, fitted: Robot) -> LogResiduals:
    """Return the residuals of a prepared problem's robot and of `fitted`."""
    robot = problem.robot
    names, units = output_names(robot)
    return LogResiduals(
        outputs=names,
        units=units,
        driven=robot.transmission.size,
        floor=problem.floor.values,
        floor_source=problem.floor.source,
        runs=tuple(_run(robot, fitted, record) for record in problem.records),
    )


def output_names(robot: Robot) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return name and unit of every output of a residual: driven joints, then the rest."""
    names, units = coordinate_names(robot)
    order = [*robot.actuated, *robot.unactuated]
    sensors = [f"{joint} (link side)" for joint in robot.torque_sensors]
    behind = [units[row] for row in robot.actuated[robot.sensed]]
    return (*(names[row] for row in order), *sensors), (*(units[row] for row in order), *behind)


def _run(robot: Robot, fitted: Robot, record: Record) -> ResidualRun:
    gears = robot.transmission
    rows = slice(record.edge, len(record.torque) - record.edge, record.stride)
    motion = record.motion
    speed = np.concatenate(
        [
            motion.velocity[:, robot.actuated] @ gears.motor_from_joint.T,
            motion.velocity[:, robot.unactuated],
            motion.velocity[:, robot.actuated[robot.sensed]],
        ],
        axis=1,
    )[rows]
    position = np.full(speed.shape, np.nan)
    position[:, : gears.size] = motion.position[rows][:, robot.actuated_position]
    load = np.full(speed.shape, np.nan)
    load[:, : gears.size] = (record.torque * gears.gear_ratio)[rows]
    return ResidualRun(
        name=record.name,
        time=record.time,
        before=condensed_residual(robot, [record]),
        after=condensed_residual(fitted, [record]),
        position=position,
        speed=speed,
        load=load,
        unused=tuple(_stretches(weight < _HALF, record) for weight in record.weight.T),
    )


def _stretches(inside: BoolArray, record: Record) -> FloatArray:
    """Return starts and ends (k, 2) [s] of the rows inside, within the rows that are plotted."""
    shown = inside[record.edge : len(inside) - record.edge]
    changed = np.flatnonzero(np.diff(np.concatenate([[False], shown, [False]]).astype(int)))
    ends = record.time[0] + (changed.reshape(-1, 2) - [0, 1]) / record.rate
    return np.asarray(ends)


Curve = tuple[FloatArray, FloatArray]

_BINS = 24
_LEAST = 8
_DECIDES = 0.5
_MATTERS = 0.1


def explained_curves(x: FloatArray, explained: FloatArray, speed: FloatArray) -> tuple[Curve, ...]:
    """Return the mean of `explained` over `x`, where `x` decides it.

    One curve where `x` alone accounts for more than half of its variance; two, for either
    direction of motion, where both together do: what a gear loses has a branch for each. None where
    `x` does not decide.

    Args:
        x: (rows,) what is on the axis.
        explained: (rows,) residual of the robot as given minus that with the effects.
        speed: (rows,) of the joint.
    """
    spread = float(np.var(explained)) * len(x)
    if spread == 0.0 or not np.isfinite(x).all():
        return ()
    for split in (np.ones(x.shape, dtype=bool),), (speed > 0.0, speed < 0.0):
        if min(int(part.sum()) for part in split) < 2 * _LEAST:
            continue
        within = sum(float(np.var(explained[part])) * int(part.sum()) for part in split)
        curves = tuple(binned_mean(x[part], explained[part]) for part in split)
        left = sum(
            float(np.sum((explained[part] - np.interp(x[part], *curve)) ** 2))
            for part, curve in zip(split, curves, strict=True)
        )
        # Two branches that do not depend on `x` are a matter of the direction alone.
        if within > _MATTERS * spread and left < _DECIDES * within:
            return curves
    return ()


def binned_mean(x: FloatArray, y: FloatArray, bins: int = _BINS) -> Curve:
    """Return mean x and mean y in bins of equal count, ordered by x; at least eight in a bin."""
    order = np.argsort(x)
    parts = np.array_split(order, max(1, min(bins, len(x) // _LEAST)))
    return (
        np.array([np.mean(x[part]) for part in parts]),
        np.array([np.mean(y[part]) for part in parts]),
    )
