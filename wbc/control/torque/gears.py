"""The mesh law as the controller uses it: blended near standstill, linear in each direction."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.control.torque.blending import allowed, place_slopes
from wbc.transmission import Direction, Transmission, mesh_input_interval


class RestPolicy(Enum):
    """Which mesh input torque to choose where a gear stands still and T fixes only an interval.

    NEUTRAL passes T through as if without loss; LEAST_TORQUE takes the end of least magnitude and
    lets friction carry the rest; MOST_MARGIN takes the middle, farthest from slipping either way.
    """

    NEUTRAL = "neutral"
    LEAST_TORQUE = "least_torque"
    MOST_MARGIN = "most_margin"


class Slopes(NamedTuple):
    """Mesh input torque per output torque, t = slope T, (m,) for either sign of T."""

    positive: FloatArray
    negative: FloatArray

    def at(self, output_positive: BoolArray) -> FloatArray:
        """Return the slope of each gear for the given signs of T."""
        return np.where(output_positive, self.positive, self.negative)


class GearState(NamedTuple):
    """What one tick knows of the gears before it is solved.

    Attributes:
        sigma: certainty (m,) of the directions.
        limits: least and greatest N tau_phi (m,) [N m].
        speed: expected dpsi (m,) [rad/s].
        last_output: T (m,) of the last tick [N m].
    """

    sigma: FloatArray
    limits: tuple[FloatArray, FloatArray]
    speed: FloatArray
    last_output: FloatArray


class GearLaw:
    """Mesh input torque as a function of output torque and of where the joint is going.

    sigma in [-1, 1] says how surely each gear turns and which way: at +-1 the branch of the mesh
    law holds, t = T/eta_f where T sigma > 0 and eta_b T where T sigma < 0; in between it is blended
    with the torque that the policy prefers at rest. Every blend of the three lies inside the
    interval that holds T at rest.

    Attributes:
        blended: the slopes (m,) at rest, where T sigma > 0, and where T sigma < 0.
    """

    def __init__(self, gears: Transmission, policy: RestPolicy, margin: float = 0.0) -> None:
        """Precompute the three slopes of every gear.

        Args:
            gears: of the robot.
            policy: what to choose at rest.
            margin: share of the interval at rest that is kept free at either end, 0 to 0.5.
        """
        self._policy, self._margin = policy, margin
        # the slopes keep their memory: compiled functions know where it is
        self._rest, self._forward, self._backward = np.empty((3, gears.size))
        self.blended = self._rest, self._forward, self._backward
        self.follow(gears.forward_efficiency, gears.backward_efficiency)

    def follow(self, forward_efficiency: FloatArray, backward_efficiency: FloatArray) -> None:
        """Take the efficiencies (m,) that the gears have from now on."""
        self._efficiencies = forward_efficiency, backward_efficiency
        self._forward[:], self._backward[:] = 1.0 / forward_efficiency, backward_efficiency
        low = np.minimum(self._forward, self._backward)
        high = np.maximum(self._forward, self._backward)
        preferred = {
            RestPolicy.NEUTRAL: np.ones(low.size),
            RestPolicy.LEAST_TORQUE: np.zeros(low.size),
            RestPolicy.MOST_MARGIN: 0.5 * (low + high),
        }[self._policy]
        free = self._margin * (high - low)
        self._rest[:] = np.clip(preferred, low + free, high - free)

    def slopes(self, sigma: FloatArray) -> Slopes:
        """Return the slopes for gears that turn with certainty and direction `sigma` (m,)."""
        positive, negative = np.empty(len(sigma)), np.empty(len(sigma))
        place_slopes(sigma, *self.blended, positive, negative)
        return Slopes(positive, negative)

    def interval(self, output: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest mesh input (m,) that transmit `output` T at `sigma`.

        At rest it is the whole interval of the mesh law, in motion the branch alone.
        """
        low, high = mesh_input_interval(output, *self._efficiencies)
        branch = np.where(output * sigma > 0.0, self._forward, self._backward) * output
        size = np.abs(sigma)
        return (1.0 - size) * low + size * branch, (1.0 - size) * high + size * branch

    def consistent(
        self, directions: FloatArray, output: FloatArray, mesh_input: FloatArray
    ) -> bool:
        """Whether the mesh law allows `mesh_input` t and `output` T in these directions.

        FORWARD needs t = T/eta_f, BACKWARD t = eta_b T, STUCK t anywhere between the two; all
        within 1e-6 of the largest torque.
        """
        return allowed(directions, output, mesh_input, self._forward, self._backward)


def gear_directions(output: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the `Direction` of each gear (m,): STUCK unless it surely turns under load."""
    return np.where(np.abs(sigma) >= 1.0, np.sign(output * sigma), float(Direction.STUCK))
