"""How gears with springs or play hold on to their joints in one step: the flanks' law, linear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.transmission.flank_steps import flank_impulse

_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


@dataclass(frozen=True, eq=False, slots=True)
class Grip:
    """What gears pass in a step, near the relative speeds at which it is taken to end.

    A rigid flank that is reached stops the relative motion; what it is overrun by, at most one
    step, stays.

    Attributes:
        end: (m,) relative speeds at the end, motor outputs ahead of joints [rad/s].
        impulse: (m,) [N m s] that springs and soft flanks pass there.
        slope: (m,) its change per speed [N m s^2/rad]; zero where there is no spring.
        damped: (m,) what of the impulse is not the springs' [N m s].
        held: (m,) whether a gear holds on to its joint at all.
    """

    end: FloatArray
    impulse: FloatArray
    slope: FloatArray
    damped: FloatArray
    held: BoolArray

    @classmethod
    def firm(cls, drive: Drivetrain) -> Grip:
        """Return that of gears without springs or play."""
        return cls(drive.zero, drive.zero, drive.zero, drive.zero, np.ones(drive.size, dtype=bool))

    @classmethod
    def at(cls, drive: Drivetrain, motor: MotorMotion, end: FloatArray, step: float) -> Grip:
        """Return the grip at speeds `end` (m,), by `flank_impulse`.

        Springs take the chord of their energy (theta 1/2), dampers the final speed (theta_c 1).

        Args:
            drive: constant part.
            motor: motion at the start.
            end: (m,) [rad/s].
            step: h [s].
        """
        impulse, slope, damped = np.zeros((3, drive.size))
        soft = np.isfinite(drive.stiffness)
        half, relative, place = 0.5 * drive.play, motor.relative, motor.deflection
        for i in np.flatnonzero(soft).tolist():
            law = drive.stiffness[i], drive.damping[i], half[i], step, 0.5, 1.0
            impulse[i], slope[i], _, damped[i] = flank_impulse(*law, place[i], relative[i], end[i])
        hangs = drive.loose & (np.abs(place + 0.5 * step * relative) < half)
        held = np.where(soft, (slope > 0.0) | (impulse != 0.0), ~hangs)
        return cls(np.array(end), impulse, slope, damped, held)

    def without(self, pulling: BoolArray) -> Grip:
        """Return the grip without rigid flanks (m,) that would pull."""
        return Grip(self.end, self.impulse, self.slope, self.damped, self.held & ~pulling)

    def steepened(self, slope: FloatArray) -> Grip:
        """Return the grip with slopes (m,) at least as large as those given."""
        slope = np.where(self.held, np.maximum(self.slope, slope), self.slope)
        return Grip(self.end, self.impulse, slope, self.damped, self.held)

    def secant(self, passed: Grip) -> FloatArray:
        """Return the change (m,) of the impulse per speed on the way to another grip."""
        way = passed.end - self.end
        change = (passed.impulse - self.impulse) / np.where(way == 0.0, 1.0, way)
        return np.asarray(np.where(way == 0.0, 0.0, np.maximum(change, 0.0)))

    def misses(self, passed: Grip) -> BoolArray:
        """Return which gears (m,) pass something else at the speeds at which the step ends."""
        linear = self.impulse + self.slope * (passed.end - self.end)
        off, size = np.abs(passed.impulse - linear), np.abs(passed.end) + np.abs(self.end)
        return np.asarray(off > _MET * (np.abs(passed.impulse) + self.slope * size))
