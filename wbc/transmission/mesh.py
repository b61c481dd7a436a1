"""The laws of a gear: a mesh that loses power both ways, and flanks that yield or have play.

And machines whose efficiencies follow from their geometry: a wedge, a compound planetary gear.

All torques are referred to the output side of the gear [N m]: `t` is what the rotor gives to the
mesh after its own inertia and friction are paid, `T` is what reaches the topology. Efficiency is
power out over power in, `forward_efficiency` when the motor drives and `backward_efficiency` when
the joint drives (Sim & Ramos, section II, with the wedge's efficiencies corrected; see
docs/method/physics.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from math import cos, tan

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, Ranged, must
from wbc.errors import TransmissionError


class Direction(IntEnum):
    """Direction of the power through one mesh."""

    BACKWARD = -1
    STUCK = 0
    FORWARD = 1


def wedge_backward_efficiency(forward_efficiency: ArrayLike) -> FloatArray:
    """Return eta_b = 2 - 1/eta_f, the wedge's relation between the two efficiencies.

    On a wedge eta_f = 1/(1 + k) and eta_b = 1 - k with k = mu tan(alpha), hence the relation; it
    reaches zero (self-locking) at eta_f = 1/2, as the paper states of equation (38) of its [9].

    Raises:
        TransmissionError: eta_f outside (0, 1].
    """
    return np.asarray(2.0 - 1.0 / shares(forward_efficiency, "forward efficiency"))


def shares(values: ArrayLike, name: str) -> FloatArray:
    """Return efficiencies (...) as an array.

    Raises:
        TransmissionError: one of them outside (0, 1].
    """
    eta = np.asarray(values, dtype=np.float64)
    if not np.all((eta > 0.0) & (eta <= 1.0)):
        raise TransmissionError(f"{name} must lie in (0, 1], got {eta.tolist()}.")
    return eta


def mesh_input(
    output_torque: ArrayLike,
    speed: ArrayLike,
    forward_efficiency: ArrayLike,
    backward_efficiency: ArrayLike,
) -> FloatArray:
    """Return the mesh input torque t that a moving gear needs to put out T.

    t = T/eta_f where T v > 0, t = eta_b T where T v < 0. At v = 0 any value between the two holds
    T; their mean is returned.

    Args:
        output_torque: T [N m], any shape.
        speed: output speed v [rad/s], same shape.
        forward_efficiency: eta_f, broadcast over the last axis.
        backward_efficiency: eta_b, likewise.
    """
    torque = np.asarray(output_torque, dtype=np.float64)
    sign = np.sign(np.asarray(speed, dtype=np.float64)) * np.sign(torque)
    forward = 1.0 / np.asarray(forward_efficiency, dtype=np.float64)
    backward = np.asarray(backward_efficiency, dtype=np.float64)
    gain = np.where(sign > 0, forward, np.where(sign < 0, backward, 0.5 * (forward + backward)))
    return np.asarray(torque * gain)


def direction(mesh_power: ArrayLike, *, deadband: float = 0.0) -> FloatArray:
    """Return +1 (forward), -1 (backward) or 0 (stuck) per gear from the mesh power t v [W].

    It is the power of the *mesh* input that decides, rotor inertia subtracted, not that of the
    rotor torque (correction 3 in docs/method/physics.md).
    """
    power = np.asarray(mesh_power, dtype=np.float64)
    return np.asarray(np.where(np.abs(power) <= deadband, 0.0, np.sign(power)))


def efficiency(
    directions: ArrayLike, forward_efficiency: ArrayLike, backward_efficiency: ArrayLike
) -> FloatArray:
    """Return the diagonal of E_m (...): eta_f where forward, 1/eta_b where backward, else 1.

    Directions (...) are +1 forward, -1 backward, 0 stuck; efficiencies are broadcast over the last
    axis.

    Raises:
        TransmissionError: backward through a self-locking gear, which has no finite 1/eta_b.
    """
    mode = np.asarray(directions, dtype=np.float64)
    backward = np.asarray(backward_efficiency, dtype=np.float64)
    if np.any((mode < 0) & (backward <= 0.0)):
        raise TransmissionError(
            "backward efficiency <= 0: this gear is self-locking and is never driven backward."
        )
    inverse = 1.0 / np.where(backward > 0.0, backward, 1.0)
    return np.asarray(np.where(mode > 0, forward_efficiency, np.where(mode < 0, inverse, 1.0)))


def stribeck(v: FloatArray, level: float | FloatArray, speed: float | FloatArray) -> FloatArray:
    """Return level * exp(-(v/speed)^2) (...), what a broken film of lubricant adds near rest.

    Args:
        v: speed of the surfaces [rad/s].
        level: at rest: a torque [N m], or a share of the load.
        speed: Stribeck speed [rad/s].
    """
    return level * np.exp(-((v / speed) ** 2))


@dataclass(frozen=True)
class Flanks:
    """The flanks of a gear, between which it may have play.

    A gear without play is a spring with a damper, which pulls and pushes. With play the link is
    free between the flanks; where it touches one, that flank gives like a spring with a damper,
    and pushes only: it lets go of a link that its damper would hold back.

    Attributes:
        stiffness: [N m/rad].
        damping: [N m s/rad].
        play: whole free play [rad].
    """

    stiffness: float
    damping: float
    play: float = 0.0

    def torque(self, deflection: ArrayLike, rate: ArrayLike) -> FloatArray:
        """Return the torque on the link (...) [N m].

        With s the side on which the link touches and d its deflection:

            -(stiffness (d - s play / 2) + damping d_d), no larger than zero times s

        Args:
            deflection: of the link, ahead of its motor's output (...) [rad].
            rate: d_d (...) [rad/s].
        """
        d, v = np.asarray(deflection, dtype=float), np.asarray(rate, dtype=float)
        if self.play == 0.0:
            return np.asarray(-self.stiffness * d - self.damping * v)
        side = np.sign(d)
        pressed = side * (self.stiffness * (d - 0.5 * side * self.play) + self.damping * v)
        touching = np.abs(d) >= 0.5 * self.play
        return np.asarray(np.where(touching, -side * np.maximum(pressed, 0.0), 0.0))


@dataclass(frozen=True)
class WedgeBlock(Ranged):
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

    block_mass: float = field(metadata=must(">= 0 kg and < inf"))
    wedge_mass: float = field(metadata=must(">= 0 kg and < inf"))
    slope: float
    friction: float = field(metadata=must(">= 0 and < inf"))

    _told, _raised = "", TransmissionError

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 <= self.slope < np.pi / 2:
            raise TransmissionError(f"slope must lie in [0, pi/2) rad, got {self.slope:g}.")
        super().__post_init__()

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

        With the paper's A' = [-1, cos(alpha)] a positive lambda [N] pushes the block along -x.
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
class CompoundPlanetaryGear(Ranged):
    """A 3K planetary gear: sun in, one ring fixed, the other ring out.

    The paper takes its backward efficiency from equation (38) of Matsuki, Nagano and Fujimoto
    (2019), who built such a gear. The relation here is derived anew, from torques and powers alone,
    and was not compared with that equation, which we have not seen.

    The sun s drives, ring r1 is fixed, ring r2 puts out, and both rings mesh with one double planet
    whose carrier is free. In the frame of the carrier the gears turn about fixed axes: power enters
    at s and r2 and leaves at r1 when the sun drives, and the other way round when r2 drives. With
    i1 = z_r1/z_s, i2 = z_r1 z_p2/(z_p1 z_r2) < 1, the free carrier's T_s + T_r1 = T_r2, and the
    share e of the power that passes the planet either way:

        N     = (1 + i1)/(1 - i2)
        eta_f = (1 + e i1)/(1 - e i2) / N              eta_b = (1 - i2/e)/(1 + i1/e) N

    Attributes:
        sun_ratio: i1 = z_r1/z_s, > 1.
        ring_ratio: i2 = z_r1 z_p2/(z_p1 z_r2), in (0, 1); close to 1 at high reductions.
    """

    sun_ratio: float = field(metadata=must("> 1 and < inf"))
    ring_ratio: float = field(metadata=must("> 0 and < 1"))

    _told, _raised = "", TransmissionError

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
