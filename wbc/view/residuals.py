"""Residuals of a robot before and after a diagnosis, with what they may depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.answer.shown import Series, series_of
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.record import Record, output_names, output_units
from wbc.measurement import Log
from wbc.robot import Robot

_HALF = 0.5

Curve = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class ResidualRun:
    """One log: residuals and what to plot them over, all (rows, outputs).

    Attributes:
        given: torques and residual of the robot that was given.
        fitted: the same of the robot with the effects found.
        position: of the joint [rad, m].
        speed: of the joint [rad/s, m/s].
        load: measured torque at the motor output [N m]; NaN for undriven coordinates.
        unused: per output, starts and ends (k, 2) [s] of the stretches that count less than half,
            as near a reversal of motion.
    """

    given: Series
    fitted: Series
    position: FloatArray
    speed: FloatArray
    load: FloatArray
    unused: tuple[FloatArray, ...]

    @property
    def time(self) -> FloatArray:
        """(rows,) [s]."""
        return self.given.time

    @property
    def before(self) -> FloatArray:
        """Measured minus modelled of the robot that was given [N m, N]."""
        return self.given.residual

    @property
    def after(self) -> FloatArray:
        """The same of the robot with the effects found."""
        return self.fitted.residual


@dataclass(frozen=True, eq=False)
class LogResiduals:
    """Residuals of several logs of one robot.

    Attributes:
        problem: the robot and its logs.
        runs: one per log.
    """

    problem: EstimationProblem
    runs: tuple[ResidualRun, ...]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names, driven joints first, then undriven coordinates."""
        return output_names(self.problem.robot)

    def stacked(self, name: str, output: int) -> FloatArray:
        """Return one of the arrays of the runs for an output, over all logs (rows,)."""
        return np.concatenate([getattr(run, name)[:, output] for run in self.runs])

    def over(self, output: int) -> list[tuple[str, str, FloatArray, tuple[Curve, ...]]]:
        """Return name, unit and values (rows,) of what a residual may depend on.

        With each come the `explained_curves` over it.
        """
        linear, found = output_units(self.problem.robot)[output] == "N", []
        explained = self.stacked("before", output) - self.stacked("after", output)
        units = ("m/s", "m", "N") if linear else ("rad/s", "rad", "N m")
        for name, unit in zip(("speed", "position", "load"), units, strict=True):
            x = self.stacked(name, output)
            if np.isfinite(x).all():
                curves = explained_curves(x, explained, self.stacked("speed", output))
                found.append((name, unit, x, curves))
        return found


def residuals_of(robot: Robot, fitted: Robot, logs: Sequence[Log]) -> LogResiduals:
    """Return the residuals of `robot` and of `fitted`, the same robot with effects, on logs.

    Raises:
        IdentificationError: logs that cannot be compared with this robot.
        LogError: a channel is missing.
    """
    problem = EstimationProblem.from_logs(robot, logs)
    return residuals_in(
        problem, series_of(robot, problem.records), series_of(fitted, problem.records)
    )


def residuals_in(
    problem: EstimationProblem, given: Sequence[Series], fitted: Sequence[Series]
) -> LogResiduals:
    """Return the residuals of a prepared problem's robot and of the fitted one, by their series."""
    each = zip(problem.records, given, fitted, strict=True)
    return LogResiduals(
        problem, tuple(_run(problem.robot, record, *both) for record, *both in each)
    )


def _run(robot: Robot, record: Record, given: Series, fitted: Series) -> ResidualRun:
    gears, motion = robot.transmission, record.motion
    rows = slice(record.edge, len(record.torque) - record.edge, record.stride)
    turning = motion.velocity[:, robot.actuated]
    parts = [turning @ gears.motor_from_joint.T, motion.velocity[:, robot.unactuated]]
    speed = np.concatenate([*parts, turning[:, robot.sensed]], axis=1)[rows]
    position, load = np.full((2, *speed.shape), np.nan)
    position[:, : gears.size] = motion.position[rows][:, robot.actuated_position]
    load[:, : gears.size] = (record.torque * gears.gear_ratio)[rows]
    unused = tuple(_stretches(weight < _HALF, record) for weight in record.weight.T)
    return ResidualRun(given, fitted, position, speed, load, unused)


def _stretches(inside: BoolArray, record: Record) -> FloatArray:
    """Return starts and ends (k, 2) [s] of the rows inside, within the rows that are plotted."""
    shown = inside[record.edge : len(inside) - record.edge]
    changed = np.flatnonzero(np.diff(np.concatenate([[False], shown, [False]]).astype(int)))
    ends = record.time[0] + (changed.reshape(-1, 2) - [0, 1]) / record.rate
    return np.asarray(ends)


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
