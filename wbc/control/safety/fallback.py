"""The commands of ticks that have no solution."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.command import Command
from wbc.control.plant import Plant
from wbc.control.safety.inputs import Complaint, state_complaint
from wbc.control.safety.policies import LastGood, SafetyPolicy
from wbc.control.torque.direction_search import Found
from wbc.control.torque.motors import Motors
from wbc.robot import Motion, Robot


class Fallback:
    """Commands what a safety policy chooses, from the last tick that had a solution."""

    def __init__(self, robot: Robot, plant: Plant, motors: Motors) -> None:
        """Start without a tick to look back on."""
        self._robot, self._plant, self._motors = robot, plant, motors
        self.forget()

    def forget(self) -> None:
        """Forget the last good tick."""
        self._torque = np.zeros(self._robot.transmission.size)
        self._motion: Motion | None = None

    def remember(self, motion: Motion, torque: FloatArray) -> None:
        """Take a tick with a solution, N tau_phi = `torque` (m,) [N m], as the last good one."""
        self._torque, self._motion = torque, motion

    def _last(self) -> LastGood:
        then = None if self._motion is None else self._motors.position(self._motion)
        return LastGood(self._torque, then)

    def command(
        self,
        policy: SafetyPolicy,
        motion: Motion,
        complaint: Complaint,
        start: float,
        found: Found | None = None,
    ) -> Command:
        """Return the safe command.

        Args:
            policy: what chooses the torque.
            motion: the state, which may be what the complaint is about.
            complaint: why the tick has no solution.
            start: when the tick began, by `perf_counter` [s].
            found: what the solver returned, None where it was not asked.
        """
        m, nv = self._robot.transmission.size, self._robot.model.nv
        known = state_complaint(self._robot, motion.position, motion.velocity) is None
        unknown = np.full(m, np.nan)
        speed = self._plant.motor_speed(motion.velocity) if known else unknown
        position = self._motors.position(motion) if known else unknown
        torque = self._motors.clipped(policy.rotor_torque(self._last(), position, speed))
        if known:
            rotor = self._motors.to_drive(motion, torque)
        else:
            rotor = torque / self._robot.transmission.gear_ratio
        status, message = complaint
        return Command(
            rotor_torque=rotor,
            acceleration=np.zeros(nv),
            forces={},
            consistent=False,
            output_torque=np.zeros(m),
            mesh_torque=np.zeros(m),
            expected_speed=np.zeros(m),
            certainty=np.zeros(m),
            status=status,
            message=message,
            solve_time=0.0 if found is None else found.solve_time,
            tick_time=perf_counter() - start,
            rounds=0 if found is None else found.rounds,
            solution=None if found is None else found.solution,
        )
