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
from scipy.integrate import solve_ivp

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.robot import Robot
from wbc.sim.laws.drivetrain import drivetrain
from wbc.sim.mechanism import Input, Mechanism, Piece
from wbc.sim.step.forces import first_memory

_MAX_PIECES = 2000
_REST = 1e-10
_AHEAD = 1e-8


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
    model, drive = robot.model, drivetrain(robot)
    coupled = drive.any_loose or robot.rotors_turn_with_links
    if model.nq != model.nv or coupled or first_memory(robot):
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
