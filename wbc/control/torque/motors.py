"""Between the gears and the drives: limits, positions and commands of the motors."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.effects import EffectTorques
from wbc.control.limits import RotorTorqueLimit
from wbc.control.selection import as_rows
from wbc.control.torque.blending import place_targets
from wbc.robot import Motion, Robot

TorqueBounds = tuple[FloatArray, FloatArray]
"""Least and greatest N tau_phi (m,) [N m]."""


class Motors:
    """The motors of a robot as the controller sees them, everything at the motor output.

    Attributes:
        limited: (m,) bool, motors that have a torque limit to keep.
        constant: least and greatest N tau_phi (m,) [N m] where they never change, else None.
    """

    def __init__(
        self, robot: Robot, limit: RotorTorqueLimit | None, effects: EffectTorques
    ) -> None:
        """Precompute what does not change with the state."""
        gears = robot.transmission
        self._robot, self._limit, self._effects = robot, limit, effects
        self._ratio = gears.gear_ratio
        self._rows = as_rows(robot.actuated_position)
        self._inverse_ratio = 1.0 / gears.gear_ratio
        direct = bool(np.array_equal(gears.topology, np.eye(gears.size)))
        self._from_joints = None if direct else gears.motor_from_joint
        nameplate = np.abs(gears.gear_ratio) * gears.torque_limit
        self._nameplate = (-nameplate, nameplate)
        unlimited = np.full(gears.size, np.inf)
        self._free = (-unlimited, unlimited)
        self.constant: TorqueBounds | None = self._free if limit is None else None
        if limit is not None and limit.is_constant and not effects.act_on_rotors:
            self.constant = self._at_output(*limit.bounds(robot, np.zeros(gears.size)))
        self.limited = np.isfinite(gears.torque_limit) & (limit is not None)

    def position(self, motion: Motion) -> FloatArray:
        """Return psi (m,) [rad]."""
        driven = motion.position[self._rows]
        return driven.copy() if self._from_joints is None else self._from_joints @ driven

    def targets(
        self, position: FloatArray, velocity: FloatArray, acceleration: FloatArray, dt: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return where the driven joints are, and how fast (m,), after `dt` [s] of qdd (nv,).

        Args:
            position, velocity: q (nq,) and v (nv,).
            acceleration: qdd (nv,).
            dt: [s].
        """
        places, rates = np.empty(len(self._ratio)), np.empty(len(self._ratio))
        place_targets(
            *(position, velocity, acceleration, dt),
            *(self._robot.actuated_position, self._robot.actuated, places, rates),
        )
        return places, rates

    def bounds(self, motion: Motion, speed: FloatArray) -> TorqueBounds:
        """Return what the motors may give to the gears at motor speeds dpsi (m,) [rad/s]."""
        if self.constant is not None or self._limit is None:
            return self._free if self.constant is None else self.constant
        low, high = self._limit.bounds(self._robot, self._ratio * speed)
        added = self._effects.on_rotors(motion)
        if added is not None:
            low, high = low + added, high + added
        return self._at_output(low, high)

    def clipped(self, torque: FloatArray) -> FloatArray:
        """Return N tau_phi (m,) within the motors' own limits, whatever the controller's are."""
        return np.minimum(np.maximum(torque, self._nameplate[0]), self._nameplate[1])

    def to_drive(self, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the drive command (m,) that puts N tau_phi = `torque` on the rotors."""
        rotor: FloatArray = torque * self._inverse_ratio
        if not self._effects.act_on_drives:
            return rotor
        added = self._effects.on_rotors(motion)
        if added is not None:
            rotor = rotor - added
        return self._effects.to_drive(motion, rotor)

    def _at_output(self, low: FloatArray, high: FloatArray) -> TorqueBounds:
        one, other = self._ratio * low, self._ratio * high
        return np.minimum(one, other), np.maximum(one, other)
