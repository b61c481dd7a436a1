"""Which way the gears turn, by what the controller expects rather than by a noisy encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.errors import ControlError


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
