"""How far a robot's model is from its logs, and where; which of several robots is nearest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import sem

from wbc.errors import IdentificationError
from wbc.files import as_json
from wbc.identification.answer.remainder import Breakdown, dependences
from wbc.identification.answer.shown import Series, Shown, efforts, plain, provenance, series_of
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.noise import NoiseFloor
from wbc.identification.records.not_judged import told_outputs
from wbc.identification.records.record import rms
from wbc.measurement import Log, LogSource
from wbc.robot import Robot
from wbc.tables import TextTable
from wbc.transmission import DRIVE_TIMES

_PLACES = 8  # rows of what an error depends on
_STANDARD_ERRORS = 2.0


@dataclass(frozen=True, eq=False)
class OutputError:
    """How well one output is explained.

    Attributes:
        output: joint (torque at the motor output) or undriven coordinate (wrench).
        unit: of `rms`, `floor` and `size`.
        rms: root mean square of the residual.
        floor: root mean square that noise alone leaves.
        size: root mean square of the measured torque; NaN for an undriven coordinate.
    """

    output: str
    unit: str
    rms: float
    floor: float
    size: float

    @property
    def ratio(self) -> float:
        """Residual in units of the floor."""
        return self.rms / self.floor


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Shown):
    """Residuals of a robot on logs.

    Attributes:
        robot: the robot.
        outputs: one entry per driven joint and undriven coordinate.
        error: root mean square of all outputs in units of the noise floor (whitened).
        floor: the noise floor and where it comes from.
        where: residual over speed, load, power, position, ..., strongest dependence first.
        series: the residual over time, one per log.
        warnings: about the logs.
        sources: where the logs came from.
    """

    robot: Robot
    outputs: tuple[OutputError, ...]
    error: float
    floor: NoiseFloor
    where: tuple[Breakdown, ...]
    series: tuple[Series, ...]
    warnings: tuple[str, ...] = ()
    sources: tuple[LogSource, ...] = ()

    @property
    def worst(self) -> OutputError:
        """The output with the largest error beside its noise floor."""
        return max(self.outputs, key=lambda output: output.ratio)

    @property
    def sentence(self) -> str:
        """How far the model is off, as a person would say it."""
        worst = self.worst
        return (
            f"The model misses these logs by {plain(worst.rms, 2)} {worst.unit} at {worst.output}, "
            f"where it is worst: {plain(worst.ratio, 2)} noise floors "
            f"({plain(self.error, 2)} over all outputs)."
        )

    def error_rows(self) -> TextTable:
        """Return the residual of every output against its floor."""
        reported = efforts(o.unit for o in self.outputs)
        cells = []
        for o in self.outputs:
            rms, floor, ratio = (plain(x, 2) for x in (o.rms, o.floor, o.ratio))
            size = "" if np.isnan(o.size) else plain(o.size)
            cells.append((o.output, o.unit, rms, size, floor, ratio))
        return TextTable.of(
            "output|unit|>residual|>measured|>floor|>x floor",
            cells,
            "error",
            f"rms {reported} over all logs; residual: measured - model; floor: noise",
        )

    def where_rows(self) -> TextTable:
        """Return the strongest dependences of the residual."""
        cells = []
        for b in self.where[:_PLACES]:
            ends = (int(b.mean.argmin()), int(b.mean.argmax()))
            means = (f"{b.mean[k]:+.2g} at {b.center[k]:.2g}" for k in ends)
            cells.append((b.output, b.variable, b.unit, f"{100.0 * b.share:.0f} %", *means))
        return TextTable.of(
            "output|depends on|unit|>share|>from|>to",
            cells,
            "where it fails",
            "share of the residual's variance that its mean over this variable explains",
        )

    def tables(self) -> tuple[TextTable, ...]:
        """Return a line per output."""
        return (self.error_rows(),)

    def models(self) -> list[tuple[str, Sequence[Series]]]:
        """Return the torques of the robot."""
        return [("model", self.series)]

    def to_json(self, command: str = "") -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries; `command` is how to run it again."""
        return {
            "robot": self.robot.name,
            "error": self.error,
            "floor_source": self.floor.source,
            "outputs": [as_json(o) | {"ratio": o.ratio} for o in self.outputs],
            "where": as_json(self.where),
            "logs": [s.name for s in self.series],
            "warnings": list(self.warnings),
            "provenance": provenance(self.sources, command),
        }


def compare(robot: Robot, logs: Sequence[Log]) -> Comparison:
    """Return how far `robot` is from `logs`, and where.

    Raises:
        IdentificationError: logs that cannot be compared with this robot, or too short ones.
        LogError: a channel is missing.
    """
    problem = EstimationProblem.from_logs(robot, logs)
    return compare_problem(problem, tuple(log.source for log in logs))


def compare_problem(problem: EstimationProblem, sources: tuple[LogSource, ...] = ()) -> Comparison:
    """Return the comparison of the robot and logs of a prepared problem.

    Args:
        problem: the robot and the logs.
        sources: where the logs came from.
    """
    records, robot = problem.records, problem.robot
    series, left = series_of(robot, records), problem.residual
    outputs, where = [], []
    for k, name, unit in told_outputs(records):
        driven = k < robot.transmission.size
        given = np.concatenate([s.measured[:, k] for s in series]) if driven else np.full(1, np.nan)
        numbers = map(float, (rms(left[:, k]), problem.floor.values[k], rms(given)))
        outputs.append(OutputError(name, unit, *numbers))
        where += dependences(records, left[:, k], k)
    return Comparison(
        robot=robot,
        outputs=tuple(outputs),
        error=float(rms((left @ problem.whitening).ravel())),
        floor=problem.floor,
        where=tuple(sorted(where, key=lambda b: -b.share)),
        series=series,
        warnings=problem.warnings,
        sources=sources,
    )


@dataclass(frozen=True)
class Contestant:
    """One robot beside the best one.

    Attributes:
        name: as given.
        error: root mean square of all outputs in noise floors.
        difference: mean square minus that of the best robot [floors^2].
        deviation: standard error of the difference, blocks of the logs being the observations.
        standing: `best`, `worse`, or `not distinguishable` from the best.
    """

    name: str
    error: float
    difference: float
    deviation: float
    standing: str


def rank_robots(robots: Mapping[str, Robot], logs: Sequence[Log]) -> tuple[Contestant, ...]:
    """Return robots by their error on logs, best first; nothing is fitted.

    All are judged in the same band, by the same weights and the noise floor of the first one. Where
    drives follow targets, the times that the first of them states are those of all. The comparison
    is fair only on logs that none of them was fitted to.

    Args:
        robots: by name; they have the same joints in the same order.
        logs: of one machine.

    Raises:
        IdentificationError: no robot, or robots with different joints.
        LogError: a channel is missing.
    """
    problem = EstimationProblem.from_logs(_reference(robots), logs)
    squares, sensors = {}, problem.robot.torque_sensors
    for name, given in robots.items():
        robot = given.with_torque_sensors(sensors)
        records = [record.believing(robot) for record in problem.records]
        squares[name] = (condensed_residual(robot, records) @ problem.whitening) ** 2
    best, *others = sorted(squares, key=lambda name: float(squares[name].mean()))
    ranked = []
    for name in (best, *others):
        apart = squares[name] - squares[best]
        difference, deviation = float(apart.mean()), float(sem(problem.block_means(apart.mean(1))))
        clear = difference > _STANDARD_ERRORS * deviation
        standing = "best" if name == best else "worse" if clear else "not distinguishable"
        error = float(np.sqrt(squares[name].mean()))
        ranked.append(Contestant(name, error, difference, deviation, standing))
    return tuple(ranked)


def _reference(robots: Mapping[str, Robot]) -> Robot:
    """Return the first robot, with the times of drives that the first of all states.

    Raises:
        IdentificationError: no robot, or robots with different joints.
    """
    if not robots:
        raise IdentificationError("no robot was given to rank.")
    first, reference = next(iter(robots.items()))
    for name, robot in robots.items():
        if robot.model.names.tolist() != reference.model.names.tolist():
            raise IdentificationError(
                f"'{name}' and '{first}' have different joints and cannot be compared: "
                f"{', '.join(robot.model.names)} and {', '.join(reference.model.names)}."
            )
    for gears in (robot.transmission for robot in robots.values()):
        if np.isfinite(gears.target_delay).any():
            return reference.with_drive_times({name: getattr(gears, name) for name in DRIVE_TIMES})
    return reference
