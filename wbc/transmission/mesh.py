"""The laws of a gear: a mesh that loses power both ways, and flanks that yield or have play.

All torques are referred to the output side of the gear [N m]: `t` is what the rotor gives to the
mesh after its own inertia and friction are paid, `T` is what reaches the topology. Efficiency is
power out over power in, `forward_efficiency` when the motor drives and `backward_efficiency` when
the joint drives (Sim & Ramos, section II, with the wedge's efficiencies corrected; see
docs/method/physics.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
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

    Args:
        forward_efficiency: eta_f in (0, 1].

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

    Args:
        directions: (...) of the power, +1 forward, -1 backward, 0 stuck.
        forward_efficiency: eta_f, broadcast over the last axis.
        backward_efficiency: eta_b, likewise.

    Raises:
        TransmissionError: backward through a self-locking gear, which has no finite 1/eta_b.
    """
    mode = np.asarray(directions, dtype=np.float64)
    backward = np.broadcast_to(np.asarray(backward_efficiency, dtype=np.float64), mode.shape)
    if np.any((mode < 0) & (backward <= 0.0)):
        raise TransmissionError(
            "backward efficiency <= 0: this gear is self-locking and is never driven backward."
        )
    inverse = 1.0 / np.where(backward > 0.0, backward, 1.0)
    forward = np.broadcast_to(np.asarray(forward_efficiency, dtype=np.float64), mode.shape)
    return np.asarray(np.where(mode > 0, forward, np.where(mode < 0, inverse, 1.0)))


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

    def scaled(self, stiffness: float, damping: float, play: float) -> Self:
        """Return the flanks with every number multiplied."""
        return type(self)(
            stiffness * self.stiffness, damping * self.damping, float(play * self.play)
        )
