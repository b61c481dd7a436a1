"""The gears of a plant: their numbers, and their laws over a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray, frozen
from wbc.compiled import OutDense, OutRow, Row, inner
from wbc.mechanics.linear import dot
from wbc.robot import Robot
from wbc.sim.state import SimState
from wbc.sim.step.tables import (
    BACKWARD,
    COULOMB,
    INERTIA,
    INVERSE,
    RATIO,
    SPEED,
    VISCOUS,
    Gears,
    Opened,
)


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


@inner
def motor_speeds(gears: Gears, v: Row, speed: OutRow) -> None:
    """Write the speeds (m,) of the motor outputs at v (nv,)."""
    rows, at, motion = gears.rows, gears.at, gears.motion
    for i in range(len(speed)):
        speed[i] = motion[i, SPEED] if at[i, 1] == 1 else dot(v, rows[i])


@inner
def gear_laws(plant: Opened, speed: Row, step: float, laws: OutDense) -> None:
    """Write the laws (m, 9) of the gears over a step: what rotors bring along, and their losses.

    Args:
        plant: with the gears, and the forces.
        speed: (m,) of the motor outputs before the step.
        step: h [s].
        laws: to write, see `RowSystem`.
    """
    gears, forces = plant.gears, plant.forces
    for i in range(len(speed)):
        gear, law = gears.numbers[i], laws[i]
        brought = step * gear[RATIO] * forces.torque[i] + gear[INERTIA] * speed[i]
        law[0], law[1] = brought - step * gear[COULOMB], brought + step * gear[COULOMB]
        law[2], law[3] = gear[INERTIA] + step * gear[VISCOUS], gear[INVERSE]
        law[4], law[5], law[6] = gear[BACKWARD], 0.0, 0.0
        if gears.direct and gear[BACKWARD] >= 0.0:
            law[5] = step * forces.friction[gears.at[i, 0]]
        law[7], law[8] = np.inf, 0.0


@inner
def rotor_brings(gear: Row, brought: float, law: OutRow) -> None:
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


@inner
def rotor_energy(gears: Gears, v: Row, motor: Row) -> float:
    """Return what rotors add to the kinetic energy at v (nv,), with motor outputs at (m,)."""
    energy = 0.0
    for g in range(len(motor)):
        energy += 0.5 * gears.numbers[g, INERTIA] * motor[g] * motor[g]
        if len(gears.coupling):
            energy += motor[g] * dot(v, gears.coupling[g])
    return energy
