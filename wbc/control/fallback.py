"""What to command when a tick has no solution: what holds the robot still, and who asks for it."""

from __future__ import annotations

from contextlib import suppress
from time import perf_counter

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Dense, OutDense, OutRow, Places, Row, compiled
from wbc.control.command import Command, Status
from wbc.control.inputs import Complaint, is_step
from wbc.control.memory import GEAR, PART
from wbc.control.qp.level import NOTHING, LevelAnswer
from wbc.control.qp.program import Recipe
from wbc.control.rows.contacts import ContactSet
from wbc.mechanics.linear import factor_inertia, halfway, products, solve_inertia
from wbc.robot import Motion

# Keeps systems solvable where contacts repeat each other; what it adds is far below a gram.
_SOFT = 1e-9
_BUSY: Complaint = (
    Status.BAD_INPUT,
    "step is called while another thread is in it; give every thread a controller of its own.",
)
_OF_GEARS = "output_torque", "mesh_torque", "expected_speed", "certainty", "velocity"
_UNASKED = {"solution": None, "refused": None, "solve_time": 0.0, "rounds": 0, "iterations": 0}
# Greatest part of a speed that damping may take away in one tick. With k ticks between encoder and
# motor a share above 2 sin(pi/(4 k + 2)) oscillates: 2 without any, 0.28 with five.
_SHARE = 0.25


class Fallback:
    """Commands what `LetDown` says, from the last tick that had a solution."""

    def __init__(self, parts: Recipe, contacts: ContactSet) -> None:
        """Start without a tick to look back on.

        Args:
            contacts: that carry the robot until a good tick says which do.
        """
        self._robot, self._motors = parts.robot, parts.drivetrain
        self._kinematics, self._weight = parts.kinematics, parts.robot.weight
        self._all = contacts
        self._policy, self._time_step = parts.settings.safety, parts.settings.time_step
        gears, self._size = parts.robot.transmission, parts.robot.transmission.size
        self._nameplate = np.abs(gears.gear_ratio) * gears.torque_limit
        self.remember(None)

    def remember(self, answer: LevelAnswer | None) -> None:
        """Take a tick with a solution as the last good one; None for none."""
        self._last, self._ticks, self._time = answer, 0, 0.0

    @property
    def _torque(self) -> FloatArray:
        """N tau_phi (m,) [N m] of the last good tick."""
        return np.zeros(self._size) if self._last is None else self._last.row(GEAR.torque)

    def _place(self, motion: Motion | None) -> FloatArray | None:
        """Return q (nq,) of a state, without one that of the last good tick."""
        if motion is not None:
            return motion.position
        return None if self._last is None else self._last.part(PART.position)

    def command(
        self,
        motion: Motion | None,
        complaint: Complaint,
        dt: float,
        start: float,
        refusal: LevelAnswer | None = None,
    ) -> Command:
        """Return the safe command; never raises.

        Args:
            motion: the state, None where it is what the complaint is about.
            complaint: why the tick has no solution.
            dt: until the next tick [s]; that of the settings where it makes no sense.
            start: of the tick, by `perf_counter` [s].
            refusal: the level that has no solution, None where none was asked.
        """
        self._motors.interrupt()
        dt = dt if is_step(dt) else self._time_step
        self._ticks += 1
        self._time += dt
        return self._made(self._rotor_torque(motion, dt), motion, complaint, start, refusal)

    def busy(self, start: float) -> Command:
        """Return the last good torque for a thread that comes in between; nothing is counted."""
        torque = _clipped(self._torque, self._nameplate) / self._robot.transmission.gear_ratio
        return self._made(torque, None, _BUSY, start, None)

    def _made(
        self,
        torque: FloatArray,
        motion: Motion | None,
        complaint: Complaint,
        start: float,
        refusal: LevelAnswer | None,
    ) -> Command:
        place, unknown = self._place(motion), np.full(self._size, np.nan)
        asked = None if refusal is None or refusal.found.solution is NOTHING else refusal
        return Command(
            rotor_torque=torque,
            acceleration=np.zeros(self._robot.model.nv),
            consistent=False,
            status=complaint[0],
            message=complaint[1],
            tick_time=perf_counter() - start,
            forces={},
            position=unknown if place is None else place[self._robot.actuated_position],
            passed={},
            prospect=asked,
            **_UNASKED if asked is None else {"refused": asked.refused},
            **dict.fromkeys(_OF_GEARS, np.zeros(self._size)),
        )

    def _rotor_torque(self, motion: Motion | None, dt: float) -> FloatArray:
        """Return the drive command (m,) of the present phase, see `LetDown`."""
        last, limits, policy = self._torque, self._robot.transmission.torque_limit, self._policy
        over, known = self._ticks - policy.ride_through, self._last is not None
        with np.errstate(all="ignore"):
            torque = last
            if not known or over > 0:
                share = 1.0 - (self._time - policy.hold) / policy.lowering
                with suppress(np.linalg.LinAlgError):  # poses far beyond all joints
                    torque = self._resting(motion, dt, min(max(share, 0.0), 1.0))
                if known and over <= policy.ride_through:
                    mixed = over / (policy.ride_through + 1.0)
                    torque = mixed * torque + (1.0 - mixed) * last
            torque = _clipped(torque, self._nameplate)
            rotor = torque / self._robot.transmission.gear_ratio
            if motion is not None:
                # An effect of the user's own may raise anything; then it is not compensated.
                with suppress(Exception):
                    rotor = self._motors.to_drive(motion, torque)
        return _clipped(rotor, limits)

    def _resting(self, motion: Motion | None, dt: float, share: float) -> FloatArray:
        """Return a share of what holds the robot against gravity, and damping (m,) [N m].

        The damping slows all motions alike at `rate`, see `held`, with h the time in which a
        quarter of the speed may go in every tick. There is none where the speed or the pose is
        unknown, the pose being the last one known.
        """
        position = self._place(motion)
        if position is None:
            return np.zeros(self._size)
        robot, kinematics, last = self._robot, self._kinematics, self._last
        rest = np.zeros(robot.model.nv)
        rows = self._all if last is None else last.level.program.contacts
        pushing = self._motors.on_joints(Motion(position, rest))
        kinematics.update(position, rest)
        rows.fill(kinematics)
        least, moved = dt / _SHARE, motion is not None and self._policy.rate > 0.0
        times = max(1.0 / self._policy.rate - least, 0.0) if moved else 0.0, least
        velocity = motion.velocity if motion is not None and moved else rest
        mass = kinematics.mass_matrix + self._motors.memory.inertia
        gravity, force = kinematics.bias - pushing, self._weight * rows.load_share
        moving, jacobian = (robot.unactuated, robot.actuated), rows.memory.rows.jacobian
        torque = held(mass, gravity, jacobian, force, moving, velocity, (share, *times))
        return np.asarray(robot.transmission.topology.T @ torque)


@compiled(inside=True)
def factored(matrix: Dense) -> OutDense:
    """Return the factor of a matrix; raise LinAlgError where that is not positive definite."""
    lower = np.empty_like(matrix)
    if not factor_inertia(matrix, lower):
        raise np.linalg.LinAlgError
    return lower


@compiled(inside=True)
def through(matrix: Dense, rows: OutDense) -> OutDense:
    """Return rows matrix^-1 rows' (r, r), and leave the rows (r, n) half done."""
    lower, gram = factored(matrix), np.empty((len(rows), len(rows)))
    for i in range(len(rows)):
        halfway(lower, rows[i])
    products(rows, gram)
    return gram


@compiled
def held(
    mass: Dense,
    gravity: Row,
    jacobian: Dense,
    force: Row,
    moving: tuple[Places, Places],
    velocity: Row,
    slows: tuple[float, float, float],
) -> OutRow:
    """Return the torque on the driven joints (m,) that holds a share of the weight, and damping.

    Forces of the contacts, those nearest to equal shares of the weight, balance the undriven
    coordinates u as far as they can; what they cannot balance moves the base, and the driven
    joints m are held beside it:

        a = M_uu^-1 (J_u' f - g_u),    T = M_mu a + g_m - J_m' f.

    Torques alone accelerate the joints by F = (M^-1)_mm, and by C = F - (M^-1 J')_m (J M^-1 J')^-1
    (J M^-1)_m while the contacts rest. With h a least time the damping is
    -((1 / rate - h) C + h F)^-1 v_m. What no contact hinders (C = F) slows at `rate`; with the
    contacts at rest, where the motors feel more inertia, nothing slows faster; and should the
    contacts be gone, nothing loses more than its share in h. The matrix is positive definite: the
    torque only takes energy.

    Args:
        mass, gravity, jacobian: M (nv, nv) with rotors, g (nv,) and J (k, nv) of the contacts.
        force: equal shares of the weight (k,) [N].
        moving: which coordinates are undriven, and which are driven.
        velocity: v (nv,), zero for no damping.
        slows: share of the weight, 1 / rate - h and h [s].

    Raises:
        LinAlgError: a matrix that has no inverse.
    """
    (u, m), (share, more, least), size = moving, slows, len(moving[1])
    on_base = np.ascontiguousarray(jacobian[:, u])
    base = gravity[u] - force @ on_base
    solve_inertia(factored(on_base.T @ on_base + _SOFT * np.eye(len(u))), base)
    left = gravity - (force + on_base @ base) @ jacobian
    of_base, base = mass[u], left[u]
    solve_inertia(factored(of_base[:, u].copy()), base)
    torque, damping = left[m] - base @ of_base[:, m].copy(), velocity[m]
    moved = through(mass, np.vstack((np.eye(len(mass))[m], jacobian)))
    freely, pushed, normal = moved[:size, :size], moved[:size, size:], moved[size:, size:]
    firm = normal + _SOFT * (1.0 + np.trace(normal)) * np.eye(len(normal))
    slowing = (more + least) * freely - more * through(firm, pushed.copy())
    solve_inertia(factored(slowing), damping)
    return share * torque - damping


def _clipped(torque: FloatArray, limit: FloatArray) -> FloatArray:
    """Return torques (m,) within +-limit (m,); what is not finite counts as zero."""
    return np.minimum(np.maximum(np.where(np.isfinite(torque), torque, 0.0), -limit), limit)
