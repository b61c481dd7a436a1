"""What a comparison says: how far a robot's model is from its logs, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.answer.breakdown import Breakdown
from wbc.identification.records.noise_floor import NoiseFloor
from wbc.robot import Robot

HORIZON = 0.2  # [s] over which positions are predicted


@dataclass(frozen=True, eq=False)
class Series:
    """One log's torques over time, in the band of the residual.

    Attributes:
        name: of the log.
        time: (rows,) [s].
        measured: (rows, m) reported torque at the motor output [N m].
        residual: (rows, m + b) measured minus modelled [N m, N].
    """

    name: str
    time: FloatArray
    measured: FloatArray
    residual: FloatArray


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
        rollout: rms error of the position predicted over `horizon` from a measured state [rad].
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
    rollout: float
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
        horizon: of the rollout [s].
        warnings: about the logs.
    """

    robot: Robot
    outputs: tuple[OutputError, ...]
    error: float
    floor: NoiseFloor
    where: tuple[Breakdown, ...]
    series: tuple[Series, ...]
    horizon: float = HORIZON
    warnings: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "robot": self.robot.name,
            "error": self.error,
            "floor_source": self.floor.source,
            "horizon": self.horizon,
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
                    "rollout": o.rollout,
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
                    "centre": b.centre.tolist(),
                    "mean": b.mean.tolist(),
                    "rms": b.rms.tolist(),
                }
                for b in self.where
            ],
            "logs": [s.name for s in self.series],
            "warnings": list(self.warnings),
        }
