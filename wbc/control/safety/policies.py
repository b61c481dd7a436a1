"""What to command when a tick has no solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

import numpy as np

from wbc.arrays import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class LastGood:
    """What the controller remembers of the last tick that had a solution.

    Attributes:
        rotor_torque: (m,) [N m] commanded then, zero before the first.
        motor_position: psi (m,) [rad] then, None before the first.
    """

    rotor_torque: FloatArray
    motor_position: FloatArray | None


class SafetyPolicy(Protocol):
    """Chooses a rotor torque without a program; never raises, never returns what is not finite."""

    def rotor_torque(self, last: LastGood, position: FloatArray, speed: FloatArray) -> FloatArray:
        """Return N tau_phi (m,) [N m] before the limits.

        Args:
            last: the last tick that had a solution, its torque as N tau_phi.
            position: psi (m,) [rad], not necessarily finite.
            speed: dpsi (m,) [rad/s], not necessarily finite.
        """


@final
@dataclass(frozen=True)
class RepeatLast:
    """Repeats the last good torque."""

    def rotor_torque(self, last: LastGood, position: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the last good torque (m,)."""
        return last.rotor_torque.copy()


@final
@dataclass(frozen=True)
class Damped:
    """Brakes every joint and lets go of the rest.

    Attributes:
        gain: [N m s/rad] at the motor output.
    """

    gain: float = 5.0

    def rotor_torque(self, last: LastGood, position: FloatArray, speed: FloatArray) -> FloatArray:
        """Return -gain dpsi (m,), zero where the speed is not finite."""
        return np.where(np.isfinite(speed), -self.gain * speed, 0.0)


@final
@dataclass(frozen=True)
class Hold:
    """Keeps the joints where they were at the last good tick, on top of the torque of then.

    Attributes:
        stiffness: [N m/rad] at the motor output.
        gain: [N m s/rad] at the motor output.
    """

    stiffness: float = 200.0
    gain: float = 10.0

    def rotor_torque(self, last: LastGood, position: FloatArray, speed: FloatArray) -> FloatArray:
        """Return last torque + stiffness (psi_last - psi) - gain dpsi (m,).

        A position or speed that is not finite adds nothing.
        """
        torque = last.rotor_torque.copy()
        if last.motor_position is not None:
            pull = self.stiffness * (last.motor_position - position)
            torque += np.where(np.isfinite(pull), pull, 0.0)
        return torque - np.where(np.isfinite(speed), self.gain * speed, 0.0)
