"""What to command when a tick has no solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError

_SHARE = 0.25
"""Greatest part of a speed that damping may take away in one tick.

With k ticks between encoder and motor a share above 2 sin(pi/(4 k + 2)) oscillates: 2 without
any, 0.28 with five.
"""


class Statics(NamedTuple):
    """What holds a robot still, at the motor outputs.

    Attributes:
        hold: torque (m,) [N m] that keeps the joints at rest under gravity, on the contacts of the
            last good tick.
        free: (m, m) [1/(kg m^2)], accelerations per torque without any contact, rotors included.
        rested: (m, m) [1/(kg m^2)], the same while the contacts rest.
    """

    hold: FloatArray
    free: FloatArray
    rested: FloatArray


@dataclass(frozen=True, eq=False)
class LastGood:
    """What the controller remembers of the last tick that had a solution.

    Attributes:
        rotor_torque: (m,) [N m] commanded then, as N tau_phi; zero before the first.
        motor_position: psi (m,) [rad] then, None before the first.
    """

    rotor_torque: FloatArray
    motor_position: FloatArray | None


@dataclass(frozen=True, eq=False)
class Situation:
    """What a safety policy may know.

    Attributes:
        last: the last tick that had a solution.
        position: psi (m,) [rad], NaN where unknown.
        speed: dpsi (m,) [rad/s], NaN where unknown.
        ticks: how many ticks in a row had no solution, this one included.
        time: since the last good tick [s].
        dt: time until the next tick [s].
        find_statics: computes `statics`.
    """

    last: LastGood
    position: FloatArray
    speed: FloatArray
    ticks: int
    time: float
    dt: float
    find_statics: Callable[[], Statics]

    @cached_property
    def statics(self) -> Statics:
        """What holds the robot still, computed when it is first asked for."""
        return self.find_statics()

    def braking(self, rate: float) -> FloatArray:
        """Return a torque (m,) [N m] that slows all motions alike at `rate` [1/s].

        With F and C the accelerations per torque, free and with the contacts at rest, and h the
        time in which a quarter of the speed may go in every tick, it is
        -((1 / rate - h) C + h F)^-1 dpsi. What no contact hinders (C = F) slows at `rate`; with the
        contacts at rest, where the motors feel more inertia, nothing slows faster; and should the
        contacts be gone, nothing loses more than a quarter of its speed in a tick. The matrix is
        positive definite: the torque only takes energy. Zero where a speed is unknown.
        """
        least = self.dt / _SHARE
        if not rate > 0.0 or not np.isfinite(self.speed).all() or not self.statics.free.any():
            return np.zeros(self.speed.shape)
        more, (_, free, rested) = max(1.0 / rate - least, 0.0), self.statics
        return np.asarray(-np.linalg.solve(more * rested + least * free, self.speed))


class SafetyPolicy(Protocol):
    """Chooses a rotor torque without a program; what is not finite counts as zero."""

    def rotor_torque(self, situation: Situation) -> FloatArray:
        """Return N tau_phi (m,) [N m] before the limits."""


@final
@dataclass(frozen=True)
class LetDown:
    """Rides through, holds the robot against gravity, then lets it down gently.

    The last good torque is repeated for a few ticks, as most bad ticks come alone. Then the
    torque goes over, within as many ticks, to what holds the robot still, with the damping of
    `Situation.braking`. After `hold` the part against gravity fades out over `lowering`; the
    damping stays. Compensating gravity and damping put no energy into a motion on an arm: with g
    the gravity torque, d/dt (1/2 v'M v) = v'(tau - g) <= 0, and losses of the gears only take
    more.

    Attributes:
        ride_through: ticks that repeat the last good torque.
        hold: [s] for which gravity is held in full.
        lowering: [s] in which the robot is let down then.
        rate: [1/s] of the damping.
    """

    ride_through: int = 5
    hold: float = 1.0
    lowering: float = 3.0
    rate: float = 50.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.ride_through >= 0 or not self.hold >= 0.0:
            raise ControlError("let down: ride_through and hold must be >= 0.")
        if not self.lowering > 0.0 or not 0.0 <= self.rate < np.inf:
            raise ControlError("let down: lowering must be > 0 s and rate >= 0 1/s.")

    def rotor_torque(self, situation: Situation) -> FloatArray:
        """Return the torque (m,) of the present phase."""
        last, over = situation.last, situation.ticks - self.ride_through
        known = last.motor_position is not None
        if known and over <= 0:
            return last.rotor_torque
        share = min(max(1.0 - (situation.time - self.hold) / self.lowering, 0.0), 1.0)
        torque = share * situation.statics.hold + situation.braking(self.rate)
        if not known or over > self.ride_through:
            return np.asarray(torque)
        mixed = over / (self.ride_through + 1.0)
        return np.asarray(mixed * torque + (1.0 - mixed) * last.rotor_torque)
