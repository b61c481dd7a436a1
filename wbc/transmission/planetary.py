"""The two efficiencies of a 3K compound planetary gear, from the balance of its meshes.

The paper takes its backward efficiency from equation (38) of Matsuki, Nagano and Fujimoto (2019),
who built such a gear. The relation here is derived anew, from torques and powers alone, and was not
compared with that equation, which we have not seen.

The sun s drives, ring r1 is fixed, ring r2 puts out, and both rings mesh with one double planet
whose carrier is free. In the frame of the carrier the gears turn about fixed axes: power enters at
s and r2 and leaves at r1 when the sun drives, and the other way round when r2 drives. With
i1 = z_r1/z_s, i2 = z_r1 z_p2/(z_p1 z_r2) < 1, the free carrier's T_s + T_r1 = T_r2, and the share e
of the power that passes the planet either way:

    N     = (1 + i1)/(1 - i2)
    eta_f = (1 + e i1)/(1 - e i2) / N              eta_b = (1 - i2/e)/(1 + i1/e) N
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import TransmissionError


@dataclass(frozen=True)
class CompoundPlanetaryGear:
    """A 3K planetary gear: sun in, one ring fixed, the other ring out.

    Attributes:
        sun_ratio: i1 = z_r1/z_s, > 1.
        ring_ratio: i2 = z_r1 z_p2/(z_p1 z_r2), in (0, 1); close to 1 at high reductions.
    """

    sun_ratio: float
    ring_ratio: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 1.0 < self.sun_ratio < np.inf:
            raise TransmissionError(f"sun_ratio must be > 1, got {self.sun_ratio:g}.")
        if not 0.0 < self.ring_ratio < 1.0:
            raise TransmissionError(f"ring_ratio must lie in (0, 1), got {self.ring_ratio:g}.")

    @classmethod
    def of_reduction(cls, reduction: float, sun_ratio: float) -> CompoundPlanetaryGear:
        """Return the gear of a reduction N > 1 + i1 with a given i1."""
        return cls(sun_ratio, 1.0 - (1.0 + sun_ratio) / reduction)

    @property
    def reduction(self) -> float:
        """N = (1 + i1)/(1 - i2), turns of the sun per turn of the output."""
        return (1.0 + self.sun_ratio) / (1.0 - self.ring_ratio)

    def forward_efficiency(self, basic_efficiency: ArrayLike) -> FloatArray:
        """Return eta_f for the share e of power that passes the planet, in (0, 1]."""
        e = self._checked(basic_efficiency)
        through = (1.0 + e * self.sun_ratio) / (1.0 - e * self.ring_ratio)
        return np.asarray(through / self.reduction)

    def backward_efficiency(self, basic_efficiency: ArrayLike) -> FloatArray:
        """Return eta_b for the share e that passes the planet; negative is self-locking."""
        e = self._checked(basic_efficiency)
        through = (1.0 - self.ring_ratio / e) / (1.0 + self.sun_ratio / e)
        return np.asarray(through * self.reduction)

    @property
    def locking_efficiency(self) -> float:
        """eta_f at which the gear begins to lock itself (e = i2): (1 + i1 i2)/((1+i1)(1+i2))."""
        i1, i2 = self.sun_ratio, self.ring_ratio
        return (1.0 + i1 * i2) / ((1.0 + i1) * (1.0 + i2))

    def _checked(self, basic_efficiency: ArrayLike) -> FloatArray:
        e = np.asarray(basic_efficiency, dtype=np.float64)
        if not np.all((e > 0.0) & (e <= 1.0)):
            raise TransmissionError(f"basic efficiency must lie in (0, 1], got {e.tolist()}.")
        return e
