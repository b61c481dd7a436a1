"""What to command when a tick has no solution: what holds the robot still, and who asks for it."""

from __future__ import annotations

from contextlib import suppress
from time import perf_counter

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.command import Command, Refused
from wbc.control.drivetrain import GearModel
from wbc.control.inputs import Complaint, is_step
from wbc.control.kinematics import Kinematics
from wbc.control.policies import LastGood, Situation, Statics
from wbc.control.qp.level import SolvedLevel
from wbc.control.qp.search import DirectedSolution
from wbc.control.rows.contact_set import ContactSet
from wbc.control.rows.contacts import BoundContact
from wbc.control.settings import ControllerSettings
from wbc.control.tick import TORQUE_ROW
from wbc.robot import Motion, Robot

# Keeps systems solvable where contacts repeat each other; what it adds is far below a gram.
_SOFT = 1e-9


class Fallback:
    """Commands what a safety policy chooses, from the last tick that had a solution."""

    def __init__(
        self,
        robot: Robot,
        drivetrain: GearModel,
        settings: ControllerSettings,
        contacts: tuple[BoundContact, ...],
    ) -> None:
        """Start without a tick to look back on.

        Args:
            robot, drivetrain: of the controller.
            settings: of the controller, with the policy that chooses the torque.
            contacts: that carry the robot until a good tick says which do.
        """
        self._robot, self._motors = robot, drivetrain
        self._all = contacts
        # of its own, so that nothing of a tick is overwritten
        self._kinematics = Kinematics(robot, [f for bound in contacts for f in bound.frames])
        self._sets: dict[tuple[str, ...], ContactSet] = {}
        self._policy, self._time_step = settings.safety, settings.time_step
        gears = robot.transmission
        self._nameplate = np.abs(gears.gear_ratio) * gears.torque_limit
        self.forget()

    def forget(self) -> None:
        """Forget the last good tick."""
        self._last: SolvedLevel | None = None
        self._contacts = self._all
        self._ticks, self._time = 0, 0.0

    def remember(self, answer: SolvedLevel, contacts: tuple[BoundContact, ...]) -> None:
        """Take a tick with a solution as the last good one, and the contacts that carried it."""
        self._last, self._contacts = answer, contacts
        self._ticks, self._time = 0, 0.0

    @property
    def _torque(self) -> FloatArray:
        """N tau_phi (m,) [N m] of the last good tick."""
        if self._last is None:
            return np.zeros(self._robot.transmission.size)
        return self._last.row(TORQUE_ROW)

    @property
    def _position(self) -> FloatArray | None:
        """Q (nq,) of the last good tick."""
        last = self._last
        return None if last is None else last.block[last.level.program.at.position]

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
            dt: time until the next tick [s]; that of the settings where it makes no sense.
            start: when the tick began, by `perf_counter` [s].
            found: what the solver returned, None where it was not asked.
            refused: the program that has no solution, None where there is none.
        """
        self._motors.interrupt()
        dt = dt if is_step(dt) else self._time_step
        self._ticks += 1
        self._time += dt
        return self._made(self._rotor_torque(motion, dt), motion, complaint, start, found, refused)

    def busy(self, complaint: Complaint, start: float) -> Command:
        """Return the last good torque for a thread that comes in between; nothing is counted."""
        torque = _clipped(self._torque, self._nameplate) / self._robot.transmission.gear_ratio
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
            prospect=None,
            _targets=(self._place(motion), np.zeros(m)),
            refused=refused,
            passed={},
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
                torque = _clipped(self._torque, self._nameplate)
            rotor = torque / ratio
            if motion is not None:
                # An effect of the user's own may raise anything; then it is not compensated.
                with suppress(Exception):
                    rotor = self._motors.to_drive(motion, torque)
        return _clipped(rotor, self._robot.transmission.torque_limit)

    def _situation(self, motion: Motion | None, dt: float) -> Situation:
        """Return what policies see, with statics of the present pose or the last known one."""
        m, last = self._robot.transmission.size, self._position
        unknown, place = np.full(m, np.nan), last if motion is None else motion.position

        def statics() -> Statics:
            if place is None:
                return Statics(np.zeros(m), np.zeros((m, m)), np.zeros((m, m)))
            return self._statics(place)

        return Situation(
            last=LastGood(self._torque, None if last is None else self._motors.position(last)),
            position=unknown if motion is None else self._motors.position(motion.position),
            speed=unknown if motion is None else self._motors.speed(motion.velocity),
            ticks=self._ticks,
            time=self._time,
            dt=dt,
            find_statics=statics,
        )

    def _statics(self, position: FloatArray) -> Statics:
        """Return what holds the robot at q (nq,) on the contacts of the last good tick.

        Forces of the contacts, those nearest to equal shares of the weight, balance the undriven
        coordinates u as far as they can; what they cannot balance moves the base, and the driven
        joints m are held beside it:

            a = M_uu^-1 (J_u' f - g_u),    T = D' (M_mu a + g_m - J_m' f).

        Torques alone accelerate the joints by F = (M^-1)_mm, and by F - (M^-1 J')_m (J M^-1 J')^-1
        (J M^-1)_m while the contacts rest.
        """
        robot, kinematics, names = self._robot, self._kinematics, [c.name for c in self._contacts]
        rest = np.zeros(robot.model.nv)
        if tuple(names) not in self._sets:
            self._sets[tuple(names)] = ContactSet(self._contacts, kinematics.model)
        rows, pushing = self._sets[tuple(names)], np.zeros(robot.model.nv)
        kinematics.update(position, rest)
        rows.fill(kinematics)
        self._motors.on_joints(Motion(position, rest), pushing, np.empty(len(rest)))
        gears, u, m = robot.transmission, robot.unactuated, robot.actuated
        B, gravity, J = gears.motor_from_joint, kinematics.bias - pushing, rows.memory.rows.jacobian
        mass = kinematics.mass_matrix.copy()
        mass[np.ix_(m, m)] += B.T @ (gears.reflected_inertia[:, None] * B)
        force, Ju = rows.load_share(kinematics.mass * kinematics.gravity), J[:, u]
        soft = _SOFT * np.eye(len(u))
        force += Ju @ np.linalg.solve(Ju.T @ Ju + soft, gravity[u] - Ju.T @ force)
        left = gravity - J.T @ force
        base = np.linalg.solve(mass[np.ix_(u, u)], -left[u])
        hold = left[m] + mass[np.ix_(m, u)] @ base
        moved = np.linalg.solve(mass, np.hstack([np.eye(len(mass))[:, m], J.T]))
        free, across, normal = moved[m, : len(m)], J @ moved[:, : len(m)], J @ moved[:, len(m) :]
        normal += _SOFT * (1.0 + np.trace(normal)) * np.eye(len(normal))
        rested = free - across.T @ np.linalg.solve(normal, across)
        return Statics(gears.topology.T @ hold, B @ free @ B.T, B @ rested @ B.T)


def _clipped(torque: object, limit: FloatArray) -> FloatArray:
    """Return torques within +-limit (m,); what is not finite counts as zero.

    Raises:
        TypeError, ValueError: no numbers, or neither one nor m of them.
    """
    values = np.broadcast_to(np.asarray(torque, dtype=np.float64), limit.shape)
    return np.clip(np.where(np.isfinite(values), values, 0.0), -limit, limit)
