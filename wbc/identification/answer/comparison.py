"""How far a robot's model is from its logs, and where; which of several robots is nearest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError, needs
from wbc.files import as_json
from wbc.identification.answer.remainder import Breakdown, breakdowns
from wbc.identification.answer.shown import (
    Series,
    efforts,
    on_one_screen,
    plain,
    provenance,
    series_of,
)
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.noise import NoiseFloor
from wbc.identification.records.not_judged import without_links
from wbc.identification.records.record import by_log, output_names, output_units
from wbc.measurement import Log, LogSource
from wbc.robot import Robot
from wbc.tables import TextTable
from wbc.transmission import DRIVE_TIMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


@dataclass(frozen=True, eq=False)
class Comparison:
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

    def __str__(self) -> str:
        """Return the sentence, and a line per output."""
        return "\n".join([self.sentence, str(self.error_rows()), *self.warnings])

    def __repr__(self) -> str:
        """Return what `print` shows, cut to one screen."""
        return on_one_screen(str(self))

    def _repr_html_(self) -> str:
        """Return the answer as a notebook shows it."""
        return f"<p><b>{escape(self.sentence)}</b></p>{self.error_rows().html()}"

    def plot(self, log: int = 0) -> Figure:
        """Return measured and modelled torque of one log over time, with the residual.

        Args:
            log: number of the log.

        Raises:
            MissingPackageError: matplotlib is not installed.
        """
        units = {o.output: o.unit for o in self.outputs[: self.robot.transmission.size]}
        with needs("view", "plot()"):
            from wbc.identification.answer.figure import torque_figure
        return torque_figure(units, [("model", self.series)], log)

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "robot": self.robot.name,
            "error": self.error,
            "floor_source": self.floor.source,
            "outputs": [as_json(o) | {"ratio": o.ratio} for o in self.outputs],
            "where": as_json(self.where),
            "logs": [s.name for s in self.series],
            "warnings": list(self.warnings),
            "provenance": provenance(self.sources),
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
    records = problem.records
    residuals = by_log(records, problem.residual)
    whitened = problem.residual @ problem.whitening
    series = series_of(problem.robot, records)
    outputs = _outputs(problem, series)
    shown = {output.output for output in outputs}
    return Comparison(
        robot=problem.robot,
        outputs=outputs,
        error=float(np.sqrt(np.mean(whitened**2))),
        floor=problem.floor,
        where=tuple(b for b in breakdowns(records, residuals) if b.output in shown),
        series=series,
        warnings=problem.warnings,
        sources=sources,
    )


def _outputs(problem: EstimationProblem, series: Sequence[Series]) -> tuple[OutputError, ...]:
    units, unknown = output_units(problem.robot), without_links(problem.robot)
    size = problem.robot.transmission.size
    given = np.full(len(units), np.nan)
    given[:size] = _rms(np.concatenate([s.measured for s in series]))
    left, floor = _rms(problem.residual), problem.floor.values
    return tuple(
        OutputError(name, units[k], float(left[k]), float(floor[k]), float(given[k]))
        for k, name in enumerate(output_names(problem.robot))
        if k not in unknown
    )


def _rms(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(rows**2, axis=0)))


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
    squares = {name: _squares(problem, robot) for name, robot in robots.items()}
    order = sorted(squares, key=lambda name: float(squares[name].mean()))
    best, ranked = squares[order[0]], []
    for name in order:
        own = squares[name]
        blocks = problem.block_means((own - best).mean(axis=1))
        deviation = float(np.std(blocks, ddof=1) / np.sqrt(blocks.size))
        difference = float(own.mean() - best.mean())
        clear = difference > _STANDARD_ERRORS * deviation
        contestant = Contestant(
            name=name,
            error=float(np.sqrt(own.mean())),
            difference=difference,
            deviation=deviation,
            standing="best" if name == order[0] else "worse" if clear else "not distinguishable",
        )
        ranked.append(contestant)
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
    drives = [robot.transmission for robot in robots.values()]
    if known := [gears for gears in drives if np.isfinite(gears.target_delay).any()]:
        times = {name: getattr(known[0], name) for name in DRIVE_TIMES}
        reference = reference.with_drive_times(times)
    return reference


def _squares(problem: EstimationProblem, robot: Robot) -> FloatArray:
    records = [record.believing(robot) for record in problem.records]
    return np.asarray((condensed_residual(robot, records) @ problem.whitening) ** 2)
