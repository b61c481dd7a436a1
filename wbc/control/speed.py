"""Which way the gears will turn, judged from what is wanted rather than from a noisy encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError


@dataclass(frozen=True)
class SpeedBlend:
    """How sure the controller is of the direction of a joint.

    The measured sign flips with every count of encoder noise while a joint stands, and each flip
    costs the full width of the stiction interval. The desired speed has no noise, but says nothing
    when the robot is thrown off its reference. The two are joined by believing the desired speed
    until the measured one contradicts it by more than `trusted_error`:

        v = v_des + shrink(v_meas - v_des, trusted_error),   sigma = clip(v / full_speed, -1, 1).

    Attributes:
        full_speed: [rad/s] of the motor output from which a direction counts as certain.
        trusted_error: [rad/s] up to which measured and desired speed may differ for nothing; some
            five standard deviations of the velocity noise. Infinite trusts the desired speed
            alone, zero the measured one.
    """

    full_speed: float = 0.05
    trusted_error: float = 0.25

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.full_speed > 0.0:
            raise ControlError(f"full_speed must be > 0 rad/s, got {self.full_speed:g}.")
        if not self.trusted_error >= 0.0:
            raise ControlError(f"trusted_error must be >= 0 rad/s, got {self.trusted_error:g}.")

    def speed(self, desired: FloatArray, measured: FloatArray) -> FloatArray:
        """Return the speed believed in, (...) [rad/s]."""
        error = measured - desired
        beyond = np.maximum(np.abs(error) - self.trusted_error, 0.0)
        return np.asarray(desired + np.copysign(beyond, error))

    def certainty(self, speed: FloatArray) -> FloatArray:
        """Return sigma (...), -1 to 1."""
        return np.minimum(np.maximum(speed / self.full_speed, -1.0), 1.0)
