"""Which way the gears turn, by what the controller expects rather than by a noisy encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.control.torque.blending import place_advanced, place_certainty, place_judged
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

    def judged(
        self,
        expected: FloatArray,
        measured: FloatArray,
        step: float,
        driven: IntArray,
        motor_from_joint: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return what to believe of the speeds.

        Args:
            expected, measured: v (nv,) [rad/s].
            step: time since the expectation, that of a tick [s].
            driven: coordinates (m,) of the driven joints.
            motor_from_joint: D^-1 (m, m).

        Returns:
            the expected v drawn towards the measured one (nv,), the same of the motor outputs,
            their measured dpsi, and sigma, (m,).
        """
        m = len(driven)
        corrected, turning = np.empty(measured.shape), np.empty(m)
        speed, sigma = np.empty(m), np.empty(m)
        kept = 1.0 - min(self.correction * step, 1.0)
        place_judged(
            expected,
            measured,
            self.trusted_error,
            kept,
            self.full_speed,
            driven,
            motor_from_joint,
            corrected,
            turning,
            speed,
            sigma,
        )
        return corrected, turning, speed, sigma

    @staticmethod
    def advanced(speed: FloatArray, acceleration: FloatArray, step: float) -> FloatArray:
        """Return the speed (k,) that an acceleration (k,) leads to in a time step [s]."""
        advanced = np.empty(speed.shape)
        place_advanced(speed, acceleration, step, advanced)
        return advanced

    def certainty(self, speed: FloatArray) -> FloatArray:
        """Return sigma (k,), -1 to 1."""
        certainty = np.empty(speed.shape)
        place_certainty(speed, self.full_speed, certainty)
        return certainty
