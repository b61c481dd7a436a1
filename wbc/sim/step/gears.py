"""The gears of a plant: their numbers, their laws over a step, and the flanks of loose ones.

A gear is loose where it is compliant or has play: its motor output may leave the joint. What its
flanks pass is a law of the speed between both at the end of a step (`flank_impulse`); near a speed
it is a spring in series with the gear's row. Rounds move that speed until the law is met.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray, frozen
from wbc.compiled import (
    Count,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Row,
    compiled,
    group,
    several,
)
from wbc.mechanics.newton import PASSIVE, UNSOLVED, solve_system, speeds_at
from wbc.mechanics.rows import SYSTEM, RowSystem, own_speed
from wbc.robot import Robot
from wbc.sim.state import SimState
from wbc.sim.step.tables import (
    BACKWARD,
    COULOMB,
    DAMPING,
    DEFLECTION,
    GEARS,
    INERTIA,
    INVERSE,
    PLAY,
    RATIO,
    SPEED,
    STIFFNESS,
    VISCOUS,
    Gears,
)
from wbc.transmission.flank_steps import flank_impulse

_NEWTON = 8  # rounds, of the 3 to 5 that crossings take
_ROUNDS = 200
_MET = 1e-11  # of the momentum: how far an impulse may be off its flank's law


@dataclass(frozen=True, eq=False)
class Drivetrain:
    """Gears of a robot as rows; all quantities at the motor outputs psi.

    Attributes:
        rows: D^-1 on the driven columns (m, nv), psi_dot = rows @ v.
        numbers: (m, 9), columns RATIO to PLAY of `Gears`.
        forward, backward: eta_f, eta_b (m,).
        loose: (m,) whether the motor's output may leave the joint (stiffness or play).
        any_loose: whether any of them may.
        direct: whether each gear turns its joint alone and rigidly, so that joint friction and
            gear share a row; not that of a self-locking gear: the set of impulses that it holds at
            rest has a hole, which friction beside it fills.
        actuated: (m,) rows of v.
    """

    rows: FloatArray
    numbers: FloatArray
    forward: FloatArray
    backward: FloatArray
    loose: BoolArray
    any_loose: bool
    direct: bool
    actuated: IntArray

    @classmethod
    def of(cls, robot: Robot) -> Drivetrain:
        """Return the gears of `robot`."""
        gears = robot.transmission
        rows = np.zeros((gears.size, robot.model.nv))
        rows[:, robot.actuated] = gears.motor_from_joint
        # What these lose is up to their effects, which carry a state.
        kept = np.ones(gears.size, dtype=bool)
        kept[[gears.index(e.where) for e in robot.effects if "meshed" in e.acts_by]] = False
        forward, backward = (
            frozen(np.where(kept, eta, 1.0))
            for eta in (gears.forward_efficiency, gears.backward_efficiency)
        )
        ratio, loose = gears.gear_ratio, np.isfinite(gears.stiffness) | (gears.backlash > 0.0)
        viscous = ratio**2 * gears.rotor_viscous_friction
        coulomb = np.abs(ratio) * gears.rotor_coulomb_friction
        columns = ratio, gears.reflected_inertia, viscous, coulomb, 1.0 / forward, backward
        flanks = gears.stiffness, gears.damping, gears.backlash
        direct = bool(np.array_equal(gears.topology, np.eye(gears.size)) and not loose.any())
        return cls(
            frozen(rows), frozen(np.column_stack((*columns, *flanks))), forward, backward,
            frozen(loose, np.bool_), bool(loose.any()), direct, robot.actuated,
        )  # fmt: skip

    @property
    def size(self) -> int:
        """m, the number of gears."""
        return len(self.numbers)

    @property
    def ratio(self) -> FloatArray:
        """N (m,)."""
        return self.numbers[:, RATIO]

    def tables(self, coupled: bool) -> Gears:
        """Return the gears as tables for compiled loops."""
        m, nv = self.rows.shape
        at = np.column_stack((self.actuated, self.loose)).astype(np.int64).reshape(-1, 2)
        coupling = np.zeros((m if coupled else 0, nv))
        room = np.zeros((m, 2)), coupling, np.zeros((1, nv + m))
        numbers, rows = np.array(self.numbers), np.array(self.rows)
        return Gears(numbers, rows, at, *room, self.direct, self.any_loose)

    def motion(self, state: SimState) -> tuple[FloatArray, FloatArray]:
        """Return deflections (m,) [rad] and speeds (m,) [rad/s] of the motor outputs."""
        joint = self.rows @ state.velocity
        if not self.any_loose:
            return np.zeros(self.size), joint
        given = state.motor_velocity if len(state.motor_velocity) else joint
        deflection = state.deflection if len(state.deflection) else np.zeros(self.size)
        return deflection, np.where(self.loose, given, joint)

    def rotors(self, state: SimState, actuated_position: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return angles (m,) [rad], speeds (m,) [rad/s] of the rotors, zero where joints are."""
        deflection, speed = self.motion(state)
        joint = self.rows[:, self.actuated] @ state.position[actuated_position]
        return self.ratio * (joint + deflection), self.ratio * speed


@compiled(Nothing, GEARS, Row, OutRow, counted=False)
def motor_speeds(gears: Gears, v: FloatArray, speed: FloatArray) -> None:
    """Write the speeds (m,) of the motor outputs at v (nv,)."""
    rows, at, motion = gears.rows, gears.at, gears.motion
    for i in range(len(speed)):
        total = 0.0
        for j in range(len(v)):
            total += rows[i, j] * v[j]
        speed[i] = motion[i, SPEED] if at[i, 1] == 1 else total


@compiled(Nothing, GEARS, Row, Row, Row, Number, OutDense, counted=False)
def gear_laws(
    gears: Gears,
    speed: FloatArray,
    torque: FloatArray,
    friction: FloatArray,
    step: float,
    laws: FloatArray,
) -> None:
    """Write the laws (m, 9) of the gears over a step: what rotors bring along, and their losses.

    Args:
        gears: of the plant.
        speed: (m,) of the motor outputs before the step.
        torque: (m,) on the rotors.
        friction: (nv,) level of dry friction; empty for none.
        step: h [s].
        laws: to write, see `RowSystem`.
    """
    numbers, at, direct = gears.numbers, gears.at, gears.direct
    for i in range(len(speed)):
        gear, law = numbers[i], laws[i]
        brought = step * gear[RATIO] * torque[i] + gear[INERTIA] * speed[i]
        law[0], law[1] = brought - step * gear[COULOMB], brought + step * gear[COULOMB]
        law[2], law[3] = gear[INERTIA] + step * gear[VISCOUS], gear[INVERSE]
        law[4], law[5], law[6] = gear[BACKWARD], 0.0, 0.0
        if len(friction) and direct and gear[BACKWARD] >= 0.0:
            law[5] = step * friction[at[i, 0]]
        law[7], law[8] = np.inf, 0.0


@compiled(Nothing, Row, Number, OutRow, counted=False)
def rotor_brings(gear: FloatArray, brought: float, law: FloatArray) -> None:
    """Write what a rotor brings along an impact's path, in its direction and in the other one.

    Ending up in the other direction it brings eta_f eta_b M w_before, where a step, which only
    knows its end, takes all of M w_before. So the law is monotone, whatever is brought.

    Args:
        gear: (9,) columns RATIO to PLAY.
        brought: M w_before, less what the housing takes [N m s].
        law: (9,) whose first two numbers are written, see `RowSystem`.
    """
    kept = max(gear[BACKWARD], 0.0) / gear[INVERSE] * brought
    law[0] = brought if brought > 0.0 else kept
    law[1] = brought if brought < 0.0 else kept


@compiled(several(Number, Number, Number, Flag), Row, Number, Number, Number, Number, counted=False)
def flanks_at(
    gear: FloatArray, place: float, rate: float, step: float, end: float
) -> tuple[float, float, float, bool]:
    """Return what a loose gear passes at the relative speed `end`, by `flank_impulse`.

    Springs take the chord of their energy (theta 1/2), dampers the final speed (theta_c 1). A rigid
    flank that is reached stops the relative motion; what it is overrun by, at most one step, stays.

    Args:
        gear: (9,) columns RATIO to PLAY.
        place: of the motor output ahead of the joint, at the start [rad].
        rate: its change there [rad/s].
        step: h [s].
        end: its change at the end [rad/s].

    Returns:
        the impulse [N m s], its change per speed, what of it is not the spring's, and whether the
        gear holds on to its joint at all.
    """
    half = 0.5 * gear[PLAY]
    if gear[STIFFNESS] == np.inf:
        return 0.0, 0.0, 0.0, not abs(place + 0.5 * step * rate) < half
    impulse, slope, _, damped = flank_impulse(
        gear[STIFFNESS], gear[DAMPING], half, step, 0.5, 1.0, place, rate, end
    )
    return impulse, slope, damped, slope > 0.0 or impulse != 0.0


class FlankImpulses(NamedTuple):
    """What loose gears pass near the relative speeds at which a part is taken to end, (m,) each.

    Attributes:
        end: relative speeds at the end, motor outputs ahead of joints [rad/s].
        impulse: that springs and soft flanks pass there [N m s].
        slope: its change per speed; zero where there is no spring.
        damped: what of the impulse is not the springs' [N m s].
        held: 1 where a gear holds on to its joint at all.
    """

    end: FloatArray
    impulse: FloatArray
    slope: FloatArray
    damped: FloatArray
    held: FloatArray


HELD = group(FlankImpulses, *(OutRow,) * 5)


@compiled(HELD, Count)
def no_grip(m: int) -> FlankImpulses:
    """Return room for what m gears pass."""
    return FlankImpulses(np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m))


@compiled(Nothing, GEARS, Row, Number, Row, HELD, counted=False)
def take_hold(
    gears: Gears, relative: FloatArray, step: float, end: FloatArray, held: FlankImpulses
) -> None:
    """Write what loose gears pass that start at relative speeds (m,) and end at `end` (m,)."""
    for i in range(len(end)):
        if gears.at[i, 1] == 1:
            place = gears.motion[i, DEFLECTION]
            found = flanks_at(gears.numbers[i], place, relative[i], step, end[i])
            held.end[i] = end[i]
            held.impulse[i], held.slope[i], held.damped[i] = found[0], found[1], found[2]
            held.held[i] = 1.0 if found[3] else 0.0


@compiled(Nothing, GEARS, Row, Number, Row, Row, OutDense)
def grip_laws(
    gears: Gears,
    relative: FloatArray,
    step: float,
    after: FloatArray,
    motor: FloatArray,
    laws: FloatArray,
) -> None:
    """Write the springs of loose gears into laws (m, 9), of a part whose end is known.

    Args:
        gears: of the plant.
        relative: (m,) speeds of motor outputs ahead of joints at the start.
        step: h [s].
        after: v (nv,) at the end.
        motor: (m,) speeds of the motor outputs there.
        laws: whose last two columns are changed.
    """
    m = len(motor) if gears.loose else 0
    held, end = no_grip(m), motor.copy()
    for i in range(m):
        for c in range(len(after)):
            end[i] -= gears.rows[i, c] * after[c]
    if m > 0:
        take_hold(gears, relative, step, end, held)
    for i in range(m):
        if gears.at[i, 1] == 1:
            soft = gears.numbers[i, STIFFNESS] < np.inf
            hard = np.inf if held.held[i] > 0.0 else 0.0
            laws[i, 7] = held.slope[i] if soft else hard
            laws[i, 8] = held.impulse[i] - held.slope[i] * end[i] if soft else 0.0


@compiled(
    several(Count, Count, Number), GEARS, SYSTEM, Row, Number, Row, Number, OutRow, OutRow, OutRow
)  # fmt: skip
def solve_gripped(
    gears: Gears,
    system: RowSystem,
    relative: FloatArray,
    step: float,
    start: FloatArray,
    tolerance: float,
    impulse: FloatArray,
    end: FloatArray,
    damped: FloatArray,
) -> tuple[int, int, float]:
    """Solve the rows, and the flanks of loose gears by Newton's method on their law.

    One round is enough unless a flank is reached or let go within the part. Then Newton's method
    may repeat the same few guesses. The law of a flank is monotone, as all others are, so rounds
    that use the steepest slope on the way always come nearer. From the ninth round on such rounds
    alternate with Newton's, with the steepest slope met so far. Half of it is forgotten each time,
    or one steep place far off would make all that follow slow; where the rest is too little, the
    round goes too far and meets the slope between.

    Args:
        gears: of the plant.
        system: of the rows; springs of loose gears are put into its laws.
        relative: (m,) speeds of motor outputs ahead of joints at the start.
        step: h [s].
        start: (r,) impulses to start from.
        tolerance: largest accepted residual of a row.
        impulse: (r,) to write.
        end: (m,) relative speeds at the end, to write.
        damped: (m,) what of the gears' impulses is not the springs', to write.

    Returns:
        the number of linear systems solved, what `solve_system` says, and the speed by which
        flanks miss their law: zero, but where the rounds end before they meet it (PASSIVE).
    """
    if not gears.loose:
        used, way = solve_system(system, start, tolerance, 1.0, impulse)
        return used, way, 0.0
    m, size, laws = len(gears.rows), len(start), system.laws
    near, passed, safe = no_grip(m), no_grip(m), no_grip(m)
    released, steepest = np.zeros(m), np.zeros(m)
    slope, speed, guess, work, missed = np.empty(m), np.empty(size), start.copy(), 0, 0.0
    take_hold(gears, relative, step, relative, near)
    for turn in range(_ROUNDS):
        safely = turn >= _NEWTON and turn % 2 == 0
        for i in range(m):
            if gears.at[i, 1] == 0:
                continue
            soft, holds = gears.numbers[i, STIFFNESS] < np.inf, near.held[i] * (1.0 - released[i])
            steep = safely and holds > 0.0
            slope[i] = max(near.slope[i], steepest[i]) if steep else near.slope[i]
            laws[i, 7] = 0.0 if holds == 0.0 else (slope[i] if soft else np.inf)
            pulled = holds > 0.0 and soft
            laws[i, 8] = near.impulse[i] - slope[i] * near.end[i] if pulled else 0.0
        used, way = solve_system(system, guess, tolerance, 1.0, impulse)
        work += used
        if way == UNSOLVED:
            return work, way, 0.0
        guess[:] = impulse
        speeds_at(system.delassus, system.free, impulse, speed)
        met, missed = True, 0.0
        for i in range(m):
            end[i] = 0.0
            if gears.at[i, 1] == 1:
                end[i] = own_speed(laws[i], system.slope[i], impulse[i], speed[i]) - speed[i]
        take_hold(gears, relative, step, end, passed)
        for i in range(m):
            if gears.at[i, 1] == 0:
                continue
            way_there = passed.end[i] - near.end[i]
            off = abs(passed.impulse[i] - near.impulse[i] - slope[i] * way_there)
            size_of = abs(passed.end[i]) + abs(near.end[i])
            good = off <= _MET * (abs(passed.impulse[i]) + slope[i] * size_of)
            place = gears.motion[i, DEFLECTION] + 0.5 * step * relative[i]
            if gears.numbers[i, STIFFNESS] == np.inf and np.sign(place) * impulse[i] < 0.0:
                released[i], good = 1.0, False
            met = met and good
            missed = missed if good else max(missed, abs(way_there), tolerance)
            secant = 0.0
            if way_there != 0.0:
                secant = max((passed.impulse[i] - near.impulse[i]) / way_there, 0.0)
            steepest[i] = max((0.5 if safely else 1.0) * steepest[i], secant)
            damped[i] = passed.damped[i]
        if met:
            return work, way, 0.0
        following = safe if turn > _NEWTON and not safely else passed
        if safely:
            for i in range(m):
                safe.end[i], safe.impulse[i], safe.slope[i] = (
                    passed.end[i],
                    passed.impulse[i],
                    passed.slope[i],
                )
                safe.damped[i], safe.held[i] = passed.damped[i], passed.held[i]
        for i in range(m):
            near.end[i], near.impulse[i] = following.end[i], following.impulse[i]
            near.slope[i], near.held[i] = following.slope[i], following.held[i]
    return work, PASSIVE, missed
