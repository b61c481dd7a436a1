"""Event-exact motion of gears in free motion: smooth pieces integrated to high order.

Between two events every gear keeps its direction (or sticks) and the direction of its power, and
the motion is a smooth ordinary differential equation. Events are a gear that stops, one that
breaks loose, and one whose power turns round; each is located by root finding, and the next modes
come from the step program at the level of accelerations. Meant as a reference for the time step,
not as a simulator: no contacts, no limits, rigid gears, configurations that are vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.rows import branch_of
from wbc.robot import Robot
from wbc.sim import Elements, StepProgram, Unilateral, solve_program
from wbc.sim.step.forces import EffectForces, PlantEffects
from wbc.sim.step.gears import Drivetrain
from wbc.sim.step.tables import COULOMB, INERTIA, VISCOUS

_MAX_PIECES = 2000
_REST = 1e-10
_AHEAD = 1e-8


Input = Callable[[float], FloatArray]
"""A function of time [s]: rotor torques (m,) or generalised forces (nv,)."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Modes of one smooth piece: direction and gain of every gear, (m,) each."""

    sign: FloatArray
    gain: FloatArray


class Mechanism:
    """The equation of motion at the level of accelerations."""

    def __init__(self, robot: Robot, torque: Input, external: Input | None) -> None:
        """Prepare `robot` under inputs that are functions of time."""
        self.robot, self.torque, self.external = robot, torque, external
        self.drive, self.effects = Drivetrain.of(robot), PlantEffects.of(robot)
        columns = [INERTIA, VISCOUS, COULOMB]
        self.inertia, self.viscous, self.coulomb = self.drive.numbers[:, columns].T
        self.data = robot.model.createData()
        self.nv = robot.model.nv

    def terms(
        self, time: float, state: FloatArray
    ) -> tuple[FloatArray, FloatArray, EffectForces, FloatArray]:
        """Return H_l, the smooth force (nv,), the effects' forces and the gears' dry friction."""
        q, v = state[: self.nv], state[self.nv :]
        model = self.robot.model
        inertia = np.array(pin.crba(model, self.data, q))
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        forces = self.effects.forces((q, v, time), self.torque(time))
        force = forces.joint - pin.nonLinearEffects(model, self.data, q, v)
        if self.external is not None:
            force = force + self.external(time)
        dry = np.zeros(self.drive.size)
        if forces.friction is not None:
            dry = forces.friction[self.drive.actuated]
        return inertia, force, forces, dry

    def brought(self, piece: Piece, forces: EffectForces, state: FloatArray) -> FloatArray:
        """Return what the rotor brings to the mesh less its friction, (m,) [N m]."""
        drive = self.drive
        speed = drive.rows @ state[self.nv :]
        torque = drive.ratio * forces.rotor
        return np.asarray(torque - piece.sign * self.coulomb - self.viscous * speed)

    def solve(
        self, time: float, state: FloatArray, piece: Piece
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return qdd (nv,), the joint-side torque T (m,) and the friction level for given modes."""
        drive, stuck = self.drive, piece.sign == 0.0
        inertia, force, forces, dry = self.terms(time, state)
        response = np.linalg.solve(inertia, np.column_stack((drive.rows.T, force)))
        own, free = drive.rows @ response[:, :-1], drive.rows @ response[:, -1]
        on_speed = np.where(stuck, 1.0, self.inertia)
        on_torque = np.where(stuck, 0.0, piece.gain)
        loaded = self.brought(piece, forces, state) - piece.gain * piece.sign * dry
        right = np.where(stuck, 0.0, loaded) - on_speed * free
        torque = np.linalg.solve(on_speed[:, None] * own + np.diag(on_torque), right)
        return response[:, -1] + response[:, :-1] @ torque, torque, dry

    def next_piece(self, time: float, state: FloatArray, moving: FloatArray) -> Piece:
        """Return the modes that follow, from the step program with accelerations for speeds.

        A gear that moves keeps its direction: its row is shifted so far along it that no
        acceleration could turn it round.
        """
        drive, zero = self.drive, np.zeros(self.drive.size)
        inertia, force, forces, dry = self.terms(time, state)
        free = np.asarray(np.linalg.solve(inertia, force), dtype=np.float64)
        torque = drive.ratio * forces.rotor - self.viscous * (drive.rows @ state[self.nv :])
        scale = 1.0 + np.abs(free).max() + np.abs(torque).max() / self.inertia.min(initial=1.0)
        shift = 1e3 * scale * moving
        elements = Elements(
            drive.rows,
            torque - self.coulomb + self.inertia * shift,
            torque + self.coulomb + self.inertia * shift,
            self.inertia,
            drive.forward,
            drive.backward,
            dry,
            zero,
            np.full(drive.size, np.inf),
            zero,
        )
        none = np.zeros((0, self.nv))
        unilateral = Unilateral(none, none, none, np.zeros(0), np.zeros(0))
        ahead = free + np.linalg.pinv(drive.rows) @ shift
        solution = solve_program(StepProgram(inertia, ahead, elements, unilateral))
        slope = solution.system.slope
        point = solution.impulse - slope * solution.speed
        at = zip(solution.system.laws, point, slope, strict=True)
        modes = np.array([branch_of(*one) for one in at]).reshape(-1, 3)
        return Piece(modes[:, 0], modes[:, 1])

    def derivative(self, time: float, state: FloatArray, piece: Piece) -> FloatArray:
        """Return (v, qdd) of a piece."""
        return np.concatenate((state[self.nv :], self.solve(time, state, piece)[0]))

    def events(self, time: float, state: FloatArray, piece: Piece) -> FloatArray:
        """Return functions (2 m,) that are positive while the modes hold.

        Of a moving gear: its speed along its direction, and the sign of its power times the mesh
        torque. Of a stuck one: its distance from breaking loose either way.
        """
        drive = self.drive
        _, torque, dry = self.solve(time, state, piece)
        _, _, forces, _ = self.terms(time, state)
        motor = drive.ratio * forces.rotor
        speed = piece.sign * (drive.rows @ state[self.nv :])
        mesh = piece.sign * (torque + piece.sign * dry)
        driving = np.where(piece.gain == drive.backward, -1.0, 1.0)
        inverse = 1.0 / drive.forward
        plus, minus = torque + dry, torque - dry
        up = np.maximum(plus * inverse, plus * drive.backward) - (motor - self.coulomb)
        down = (motor + self.coulomb) - np.minimum(minus * inverse, minus * drive.backward)
        stuck = piece.sign == 0.0
        same = drive.backward == inverse
        return np.concatenate(
            (
                np.where(stuck, up, speed),
                np.where(stuck, down, np.where(same, 1.0, driving * mesh)),
            )
        )


@dataclass(frozen=True, eq=False)
class ExactMotion:
    """Result of `integrate_exactly`.

    Attributes:
        time: (N,) the times asked for [s].
        position, velocity: (N, nv) there.
        event_time: (E,) [s] at which the modes changed, the start included.
        event_sign: (E, m) direction of each gear from there on, 0 stuck.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    event_time: FloatArray
    event_sign: FloatArray


def integrate_exactly(
    robot: Robot,
    rotor_torque: Input,
    position: FloatArray,
    velocity: FloatArray,
    times: FloatArray,
    external: Input | None = None,
    breaks: Sequence[float] = (),
    tolerance: float = 1e-11,
) -> ExactMotion:
    """Return the motion of a robot with lossy gears in the air, exact between and at events.

    Args:
        robot: every joint of one degree of freedom, rigid gears with rotor inertia.
        rotor_torque: (m,) [N m] as a smooth function of time [s].
        position, velocity: (nv,) at times[0].
        times: (N,) increasing, at which the motion is wanted.
        external: generalised force (nv,) as a function of time.
        breaks: times at which an input jumps [s].
        tolerance: relative tolerance of the integrator.

    Raises:
        SimulationError: a robot that this method cannot follow, or modes that change without end.
    """
    model, drive = robot.model, Drivetrain.of(robot)
    coupled = drive.any_loose or robot.rotors_turn_with_links
    if model.nq != model.nv or coupled or PlantEffects.of(robot).first:
        raise SimulationError(
            f"'{robot.name}' cannot be integrated event by event: that needs joints of one degree "
            "of freedom each, rigid gears, rotors without inertial coupling and effects without a "
            "state of their own. Use Plant.step."
        )
    mechanism = Mechanism(robot, rotor_torque, external)
    state = np.concatenate((position, velocity))
    rows = np.empty((len(times), len(state)))
    rows[0] = state
    event_time: list[float] = []
    event_sign: list[FloatArray] = []
    marks = np.unique(np.concatenate(([times[0], times[-1]], np.asarray(breaks, dtype=float))))
    marks = marks[(marks >= times[0]) & (marks <= times[-1])]
    for begin, end in pairwise(marks):
        now, slope = float(begin), np.zeros(len(state))
        for _ in range(_MAX_PIECES):
            state, moving = _at_rest(mechanism, state)
            ahead = min(_AHEAD, 0.5 * (end - now))
            piece = mechanism.next_piece(now + ahead, state + ahead * slope, moving)
            if not event_sign or np.any(piece.sign != event_sign[-1]):
                event_time.append(now)
                event_sign.append(piece.sign)
            wanted = (times > now) & (times <= end)
            now, state, seen = _advance(
                mechanism, piece, now, float(end), state, times[wanted], tolerance
            )
            rows[np.flatnonzero(wanted)[: len(seen)]] = seen
            if now >= end:
                break
            slope = mechanism.derivative(now, state, piece)
        else:
            raise SimulationError(f"the modes change without end near t = {now:g} s.")
    q, v = np.split(rows, 2, axis=1)
    return ExactMotion(times, q, v, np.array(event_time), np.array(event_sign))


def _at_rest(mechanism: Mechanism, state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the state with gears that have stopped exactly at rest, and the directions (m,)."""
    rows, v = mechanism.drive.rows, state[mechanism.nv :]
    speed = rows @ v
    moving = np.where(np.abs(speed) > _REST, np.sign(speed), 0.0)
    still = np.flatnonzero(moving == 0.0)
    if still.size:
        v = v - np.linalg.pinv(rows[still]) @ speed[still]
        state = np.concatenate((state[: mechanism.nv], v))
    return state, moving


def _advance(
    mechanism: Mechanism,
    piece: Piece,
    begin: float,
    end: float,
    state: FloatArray,
    wanted: FloatArray,
    tolerance: float,
) -> tuple[float, FloatArray, FloatArray]:
    """Integrate one piece to its first event or `end`; return when, where, and the rows wanted."""
    count = 2 * mechanism.drive.size
    last: list[tuple[float, bytes, FloatArray]] = []

    def margins(time: float, y: FloatArray) -> FloatArray:
        key = y.tobytes()
        if not last or last[0][0] != time or last[0][1] != key:
            last[:] = [(time, key, mechanism.events(time, y, piece))]
        return last[0][2]

    def watch(i: int) -> Callable[[float, FloatArray], float]:
        def event(time: float, y: FloatArray) -> float:
            return float(margins(time, y)[i])

        event.terminal = True  # type: ignore[attr-defined]
        event.direction = -1.0  # type: ignore[attr-defined]
        return event

    found = solve_ivp(
        lambda time, y: mechanism.derivative(time, y, piece),
        (begin, end),
        state,
        method="DOP853",
        rtol=tolerance,
        atol=1e-3 * tolerance,
        max_step=0.02 * (end - begin) if end > begin else np.inf,
        events=[watch(i) for i in range(count)],
        dense_output=True,
    )
    if not found.success and found.status != 1:
        raise SimulationError(f"the integrator stopped at t = {found.t[-1]:g} s: {found.message}")
    stop = float(found.t[-1])
    inside = wanted[wanted <= stop]
    seen = found.sol(inside).T if len(inside) else np.zeros((0, len(state)))
    return stop, np.asarray(found.y[:, -1]), seen
