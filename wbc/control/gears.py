"""The mesh law as the controller uses it: blended near standstill, linear in each direction."""

from __future__ import annotations

from enum import Enum

import numpy as np

from wbc.arrays import FloatArray
from wbc.transmission import Direction, Transmission, mesh_input_interval


class RestPolicy(Enum):
    """Which mesh input torque to choose where a gear stands still and T fixes only an interval.

    NEUTRAL passes T through as if without loss; LEAST_TORQUE takes the end of least magnitude and
    lets friction carry the rest; MOST_MARGIN takes the middle, farthest from slipping either way.
    """

    NEUTRAL = "neutral"
    LEAST_TORQUE = "least_torque"
    MOST_MARGIN = "most_margin"


class GearLaw:
    """Mesh input torque as a function of output torque and of where the joint is going.

    sigma in [-1, 1] says how surely each gear turns and which way: at +-1 the branch of the mesh
    law holds, t = T/eta_f where T sigma > 0 and eta_b T where T sigma < 0; in between it is blended
    with the torque that the policy prefers at rest. Every blend of the three lies inside the
    interval that holds T at rest.

    Attributes:
        rest, forward, backward: the slopes (m,) at rest, where T sigma > 0, and where T sigma < 0.
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
        self.rest, self.forward, self.backward = np.empty((3, gears.size))
        self.follow(gears.forward_efficiency, gears.backward_efficiency)

    def follow(self, forward_efficiency: FloatArray, backward_efficiency: FloatArray) -> None:
        """Take the efficiencies (m,) that the gears have from now on."""
        self._efficiencies = forward_efficiency, backward_efficiency
        self.forward[:], self.backward[:] = 1.0 / forward_efficiency, backward_efficiency
        low = np.minimum(self.forward, self.backward)
        high = np.maximum(self.forward, self.backward)
        preferred = {
            RestPolicy.NEUTRAL: np.ones(low.size),
            RestPolicy.LEAST_TORQUE: np.zeros(low.size),
            RestPolicy.MOST_MARGIN: 0.5 * (low + high),
        }[self._policy]
        free = self._margin * (high - low)
        self.rest[:] = np.clip(preferred, low + free, high - free)

    def interval(self, output: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest mesh input (m,) that transmit `output` T at `sigma`.

        At rest it is the whole interval of the mesh law, in motion the branch alone.
        """
        low, high = mesh_input_interval(output, *self._efficiencies)
        branch = np.where(output * sigma > 0.0, self.forward, self.backward) * output
        size = np.abs(sigma)
        return (1.0 - size) * low + size * branch, (1.0 - size) * high + size * branch


def gear_directions(output: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the `Direction` of each gear (m,): STUCK unless it surely turns under load."""
    return np.where(np.abs(sigma) >= 1.0, np.sign(output * sigma), float(Direction.STUCK))


def consistent(
    output: FloatArray, mesh_input: FloatArray, sigma: FloatArray, slopes: FloatArray
) -> bool:
    """Whether the mesh law allows t and T (m,) in the directions that gears turn.

    FORWARD needs t = T/eta_f, BACKWARD t = eta_b T, STUCK t anywhere between the two; all within
    1e-6 of the largest torque. `slopes` (2, m) are 1/eta_f and eta_b.
    """
    directions, ends = gear_directions(output, sigma), slopes * output
    low = np.where(directions > 0.0, ends[0], np.where(directions < 0.0, ends[1], ends.min(0)))
    high = np.where(directions > 0.0, ends[0], np.where(directions < 0.0, ends[1], ends.max(0)))
    slack = 1e-6 * (1.0 + np.abs(output).max(initial=0.0))
    return bool(((low - slack <= mesh_input) & (mesh_input <= high + slack)).all())
