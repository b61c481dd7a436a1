"""What a comparison says: how far a robot's model is from its logs, and where."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.identification.answer.comparison.breakdown import Breakdown
from wbc.identification.answer.numbers import plain
from wbc.identification.answer.provenance import provenance
from wbc.identification.answer.series import Series
from wbc.identification.answer.shown import (
    data_frame,
    html_table,
    on_one_screen,
    torque_figure,
)
from wbc.identification.records.noise.noise_floor import NoiseFloor
from wbc.measurement import LogSource
from wbc.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class OutputError:
    """How well one output is explained.

    Attributes:
        output: joint (torque at the motor output) or undriven coordinate (wrench).
        unit: of `rms`, `floor` and `size`.
        rms: root mean square of the residual.
        rotor_rms: the same on the rotor [N m]; NaN for an undriven coordinate.
        floor: root mean square that noise alone leaves.
        size: root mean square of the measured torque; NaN for an undriven coordinate.
        acceleration: rms error of the acceleration predicted from the torque [rad/s^2].
        correlation_time: time after which the residual's autocorrelation falls below 1/e [s].
        frequency: where the residual's spectrum peaks [Hz].
    """

    output: str
    unit: str
    rms: float
    rotor_rms: float
    floor: float
    size: float
    acceleration: float
    correlation_time: float
    frequency: float

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

    def __str__(self) -> str:
        """Return the sentence, and a line per output."""
        lines = [self.sentence]
        lines += [
            f"  {o.output}: {plain(o.rms)} {o.unit} of {plain(o.size)} measured, "
            f"{plain(o.ratio, 2)} noise floors"
            for o in self.outputs
        ]
        return "\n".join([*lines, *self.warnings])

    def __repr__(self) -> str:
        """Return what `print` shows, cut to one screen."""
        return on_one_screen(str(self))

    def _repr_html_(self) -> str:
        """Return the answer as a notebook shows it."""
        heads = ("output", "residual", "measured", "unit", "noise floors")
        rows = [
            [o.output, plain(o.rms), plain(o.size), o.unit, plain(o.ratio, 2)] for o in self.outputs
        ]
        return f"<p><b>{escape(self.sentence)}</b></p>{html_table(heads, rows)}"

    def to_frame(self) -> Any:
        """Return a pandas frame with a row per output.

        Raises:
            MissingPackageError: pandas is not installed.
        """
        return data_frame([asdict(o) | {"ratio": o.ratio} for o in self.outputs])

    def plot(self, log: int = 0) -> Figure:
        """Return measured and modelled torque of one log over time, with the residual.

        Args:
            log: number of the log.

        Raises:
            MissingPackageError: matplotlib is not installed.
        """
        units = {o.output: o.unit for o in self.outputs[: self.robot.transmission.size]}
        return torque_figure(units, [("model", self.series)], log)

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "robot": self.robot.name,
            "error": self.error,
            "floor_source": self.floor.source,
            "outputs": [
                {
                    "output": o.output,
                    "unit": o.unit,
                    "rms": o.rms,
                    "rotor_rms": None if np.isnan(o.rotor_rms) else o.rotor_rms,
                    "floor": o.floor,
                    "ratio": o.ratio,
                    "size": None if np.isnan(o.size) else o.size,
                    "acceleration": o.acceleration,
                    "correlation_time": o.correlation_time,
                    "frequency": o.frequency,
                }
                for o in self.outputs
            ],
            "where": [
                {
                    "output": b.output,
                    "variable": b.variable,
                    "unit": b.unit,
                    "share": b.share,
                    "center": b.center.tolist(),
                    "mean": b.mean.tolist(),
                    "rms": b.rms.tolist(),
                }
                for b in self.where
            ],
            "logs": [s.name for s in self.series],
            "warnings": list(self.warnings),
            "provenance": provenance(self.sources),
        }
