"""The commands of ticks that have no solution."""

from __future__ import annotations

from contextlib import suppress
from time import perf_counter

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.command import Command, KnownProspect, Refused
from wbc.control.contacts import BoundContact
from wbc.control.output_torques import OutputTorques
from wbc.control.safety.inputs import Complaint
from wbc.control.safety.policies import LastGood, SafetyPolicy, Situation, Statics
from wbc.control.safety.standing import Standing
from wbc.control.safety.statics import place_clipped
from wbc.control.torque.direction_search import DirectedSolution
from wbc.control.torque.motors import Motors
from wbc.robot import Motion, Robot


class Fallback:
    """Commands what a safety policy chooses, from the last tick that had a solution."""

    def __init__(
        self,
        robot: Robot,
        plant: OutputTorques,
        motors: Motors,
        standing: Standing,
        policy: SafetyPolicy,
        contacts: tuple[BoundContact, ...],
    ) -> None:
        """Start without a tick to look back on.

        Args:
            robot, plant, motors: of the controller.
            standing: what finds the torques that hold the robot.
            policy: what chooses the torque.
            contacts: that carry the robot until a good tick says which do.
        """
        self._robot, self._plant, self._motors = robot, plant, motors
        self._standing, self._policy, self._all = standing, policy, contacts
        gears = robot.transmission
        self._nameplate = np.abs(gears.gear_ratio) * gears.torque_limit
        self.forget()

    def forget(self) -> None:
        """Forget the last good tick."""
        m = self._robot.transmission.size
        self._torque = np.zeros(m)
        self._position: FloatArray | None = None
        self._contacts = self._all
        self._ticks, self._time = 0, 0.0

    def remember(
        self, position: FloatArray, torque: FloatArray, contacts: tuple[BoundContact, ...]
    ) -> None:
        """Take a tick with a solution as the last good one.

        Args:
            position: q (nq,), which nobody overwrites.
            torque: N tau_phi (m,) [N m].
            contacts: that carried the robot.
        """
        self._torque, self._position = torque, position
        self._contacts = contacts
        self._ticks, self._time = 0, 0.0

    def command(
        self,
        motion: Motion | None,
        complaint: Complaint,
        dt: float,
        start: float,
        found: DirectedSolution | None = None,
        refused: Refused | None = None,
    ) -> Command:
        """Return the safe command; never raises.

        Args:
            motion: the state, None where it is what the complaint is about.
            complaint: why the tick has no solution.
            dt: time until the next tick [s].
            start: when the tick began, by `perf_counter` [s].
            found: what the solver returned, None where it was not asked.
            refused: the program that has no solution, None where there is none.
        """
        self._ticks += 1
        self._time += dt
        return self._made(self._rotor_torque(motion, dt), motion, complaint, start, found, refused)

    def busy(self, complaint: Complaint, start: float) -> Command:
        """Return the last good torque for a thread that comes in between; nothing is counted."""
        torque = self._motors.clipped(self._torque) / self._robot.transmission.gear_ratio
        return self._made(torque, None, complaint, start, None, None)

    def _made(
        self,
        torque: FloatArray,
        motion: Motion | None,
        complaint: Complaint,
        start: float,
        found: DirectedSolution | None,
        refused: Refused | None,
    ) -> Command:
        m, nv = self._robot.transmission.size, self._robot.model.nv
        status, message = complaint
        return Command.of(
            rotor_torque=torque,
            acceleration=np.zeros(nv),
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
            iterations=0 if found is None else found.iterations,
            solution=None if found is None else found.solution,
            prospect=KnownProspect({}, self._place(motion), np.zeros(m)),
            refused=refused,
        )

    def _place(self, motion: Motion | None) -> FloatArray:
        """Return where the driven joints are (m,), or last were; NaN where nobody knows."""
        position = self._position if motion is None else motion.position
        if position is None:
            return np.full(self._robot.transmission.size, np.nan)
        return np.array(position[self._robot.actuated_position])

    def _rotor_torque(self, motion: Motion | None, dt: float) -> FloatArray:
        """Return the drive command (m,); the last good torque if the policy fails."""
        ratio = self._robot.transmission.gear_ratio
        with np.errstate(all="ignore"):
            try:
                chosen = self._policy.rotor_torque(self._situation(motion, dt))
                torque = _clipped(chosen, self._nameplate)
            except Exception:  # a policy of the user's own may raise anything
                torque = self._motors.clipped(self._torque)
            rotor = torque / ratio
            if motion is not None:
                # An effect of the user's own may raise anything; then it is not compensated.
                with suppress(Exception):
                    rotor = self._motors.to_drive(motion, torque)
        return _clipped(rotor, self._robot.transmission.torque_limit)

    def _situation(self, motion: Motion | None, dt: float) -> Situation:
        unknown = np.full(self._robot.transmission.size, np.nan)
        return Situation(
            last=self._last_good(),
            position=unknown if motion is None else self._motors.position(motion),
            speed=unknown if motion is None else self._plant.motor_speed(motion.velocity),
            ticks=self._ticks,
            time=self._time,
            dt=dt,
            find_statics=lambda: self._statics(motion),
        )

    def _last_good(self) -> LastGood:
        """Return the last tick with a solution, as policies see it."""
        if self._position is None:
            return LastGood(self._torque, None)
        rest = Motion(self._position, np.zeros(self._robot.model.nv))
        return LastGood(self._torque, self._motors.position(rest))

    def _statics(self, motion: Motion | None) -> Statics:
        """Return the statics of the present pose, or of the last known one."""
        position = self._position if motion is None else motion.position
        if position is None:
            m = self._robot.transmission.size
            return Statics(np.zeros(m), np.zeros((m, m)), np.zeros((m, m)))
        return self._standing.statics(position, self._contacts)


def _clipped(torque: object, limit: FloatArray) -> FloatArray:
    """Return torques within +-limit (m,); what is not finite counts as zero.

    Raises:
        TypeError, ValueError: no numbers, or neither one nor m of them.
    """
    values = np.asarray(torque, dtype=np.float64)
    if values.shape != limit.shape:
        values = np.broadcast_to(values, limit.shape)
    clipped = np.empty(limit.shape)
    place_clipped(values, limit, clipped)
    return clipped
