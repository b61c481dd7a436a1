"""Machines whose efficiencies follow from their geometry: a wedge, and a compound planetary gear.

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
from math import cos, tan

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import TransmissionError
from wbc.transmission.mesh import Direction, shares


@dataclass(frozen=True)
class WedgeBlock:
    """A wedge (mass m, coordinate u) that pushes a block (mass M, coordinate x) by friction.

    The constraint is x = u cos(alpha); the friction force along u is
    f_d = -mu sin(alpha) |lambda| sgn(u_dot), so that the mesh force on the wedge is
    r_u = cos(alpha) (lambda - k |lambda| sgn(u_dot)) with k = mu tan(alpha). From it follow
    eta_f = 1/(1 + k) and eta_b = 1 - k. The paper prints eta_f = 1 - k and 1/eta_b = 1 + k, which
    contradicts its own statements (eta_b < eta_f; eta_b = 0 at k = 1).

    Attributes:
        block_mass: M [kg].
        wedge_mass: m [kg].
        slope: alpha [rad], in [0, pi/2).
        friction: mu >= 0.
    """

    block_mass: float
    wedge_mass: float
    slope: float
    friction: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 <= self.slope < np.pi / 2:
            raise TransmissionError(f"slope must lie in [0, pi/2) rad, got {self.slope:g}.")
        for name in ("block_mass", "wedge_mass", "friction"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise TransmissionError(
                    f"{name} must be >= 0 and finite, got {getattr(self, name):g}."
                )

    @property
    def loss_coefficient(self) -> float:
        """k = mu tan(alpha)."""
        return self.friction * tan(self.slope)

    @property
    def forward_efficiency(self) -> float:
        """eta_f = 1/(1 + k): the wedge drives the block."""
        return 1.0 / (1.0 + self.loss_coefficient)

    @property
    def backward_efficiency(self) -> float:
        """eta_b = 1 - k: the block drives the wedge; at k >= 1 it cannot."""
        return 1.0 - self.loss_coefficient

    def mesh_force(self, contact_force: float, wedge_speed: float) -> FloatArray:
        """Return r = A' lambda + f_d, (2,) [N] on [block, wedge], for a sliding wedge.

        Args:
            contact_force: lambda [N]; with the paper's A' = [-1, cos(alpha)] the block is pushed
                along -x by a positive lambda.
            wedge_speed: u_dot [m/s], not zero.
        """
        drag = -self.friction * np.sin(self.slope) * abs(contact_force) * np.sign(wedge_speed)
        return np.array([-contact_force, cos(self.slope) * contact_force + drag])

    def impedance_mass(self, mode: Direction) -> float:
        """Return the mass [kg] in the impedance X(s) = mass * s seen by the force that drives.

        FORWARD, seen by f_u/cos(alpha): M/eta_f + m/cos^2; BACKWARD, seen by f_x:
        M + m/(eta_b cos^2) (the paper's section II.C, which holds with either pair of
        efficiencies).

        Raises:
            TransmissionError: BACKWARD on a self-locking wedge, or STUCK, which has no motion.
        """
        wedge = self.wedge_mass / cos(self.slope) ** 2
        if mode is Direction.FORWARD:
            return self.block_mass / self.forward_efficiency + wedge
        if mode is Direction.BACKWARD and self.backward_efficiency > 0.0:
            return self.block_mass + wedge / self.backward_efficiency
        raise TransmissionError(
            f"the wedge does not move in mode {mode.name.lower()}"
            f" (backward efficiency {self.backward_efficiency:g})."
        )


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
        """Return eta_f (...) for the share e of power that passes the planet, in (0, 1]."""
        e = shares(basic_efficiency, "basic efficiency")
        through = (1.0 + e * self.sun_ratio) / (1.0 - e * self.ring_ratio)
        return np.asarray(through / self.reduction)

    def backward_efficiency(self, basic_efficiency: ArrayLike) -> FloatArray:
        """Return eta_b (...) for the share e that passes the planet, in (0, 1].

        At most zero is self-locking.
        """
        e = shares(basic_efficiency, "basic efficiency")
        through = (1.0 - self.ring_ratio / e) / (1.0 + self.sun_ratio / e)
        return np.asarray(through * self.reduction)
