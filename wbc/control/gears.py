"""The mesh law as the controller uses it, and how it judges which way the gears turn."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.transmission import Direction, Transmission, mesh_input_interval


class RestPolicy(Enum):
    """Which mesh input torque to choose where a gear stands still and T fixes only an interval.

    NEUTRAL passes T through as if without loss; LEAST_TORQUE takes the end of least magnitude and
    lets friction carry the rest; MOST_MARGIN takes the middle, farthest from slipping either way.
    """

    NEUTRAL = "neutral"
    LEAST_TORQUE = "least_torque"
    MOST_MARGIN = "most_margin"


@dataclass(frozen=True)
class SpeedBlend:
    """How sure the controller is of the direction of a joint.

    The measured sign flips with every count of encoder noise while a joint stands, and each flip
    costs the full width of the stiction interval; the velocity of a reference knows nothing of
    the feedback's own motions. The controller therefore goes by the speed that its own
    accelerations lead to, drawn slowly towards the measurement:

        v <- v + step qdd,   then with e = v_meas - v
        v <- v + correction step clip(e, +-trusted_error) + (e beyond trusted_error)
        sigma = clip(v / full_speed, -1, 1)

    A joint that sticks although it should move gathers expected speed until its gear is driven
    into the branch that breaks it loose; an impact, an error beyond all noise, is taken over at
    once.

    Attributes:
        full_speed: [rad/s] of the motor output from which a direction counts as certain.
        correction: [1/s] rate at which the expected speed follows the measured one.
        trusted_error: [rad/s] that noise and small disturbances explain, some five standard
            deviations of the velocity noise. With zero the measured speed is believed.
    """

    full_speed: float = 0.02
    correction: float = 30.0
    trusted_error: float = 0.25

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.full_speed > 0.0:
            raise ControlError(f"full_speed must be > 0 rad/s, got {self.full_speed:g}.")
        for name in ("correction", "trusted_error"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ControlError(f"{name} must be >= 0, got {getattr(self, name):g}.")


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
    output: FloatArray,
    mesh_input: FloatArray,
    sigma: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
) -> bool:
    """Whether the mesh law allows t and T (m,) in the directions that gears turn.

    FORWARD needs t = T/eta_f, BACKWARD t = eta_b T, STUCK t anywhere between the two; all within
    1e-6 of the largest torque. `forward` and `backward` (m,) are 1/eta_f and eta_b.
    """
    directions, ends = gear_directions(output, sigma), np.array([forward, backward]) * output
    surely = np.where(directions > 0.0, ends[0], ends[1])
    low, high = (np.where(directions == 0.0, end, surely) for end in (ends.min(0), ends.max(0)))
    slack = 1e-6 * (1.0 + np.abs(output).max(initial=0.0))
    return bool(((low - slack <= mesh_input) & (mesh_input <= high + slack)).all())
