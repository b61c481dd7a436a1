"""One sensor channel: noise, quantisation, bias and delay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError


@dataclass(frozen=True)
class Sensor:
    """One kind of channel.

    Attributes:
        noise: standard deviation of white noise, in the channel's unit.
        resolution: quantisation step, zero for none.
        bias: added to every sample.
        delay: [s] by which the reading lags behind.
    """

    noise: float = 0.0
    resolution: float = 0.0
    bias: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("noise", "resolution", "delay"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise SimulationError(f"sensor {name} must be >= 0, got {value}.")
        if not np.isfinite(self.bias):
            raise SimulationError(f"sensor bias must be finite, got {self.bias}.")

    def read(self, time: FloatArray, values: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return what the sensor reports for true values (N,) at times (N,) [s].

        Noise comes before quantisation; before the first sample the reading is the first value.
        """
        seen = np.interp(time - self.delay, time, values) if self.delay else np.array(values)
        seen = seen + self.bias + self.noise * random.standard_normal(len(seen))
        if self.resolution:
            seen = self.resolution * np.round(seen / self.resolution)
        return np.asarray(seen)
