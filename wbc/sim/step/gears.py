"""The gears of a plant: their numbers, and their laws over a step."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import OutDense, OutRow, Row, inner
from wbc.effects.tables import near_rest
from wbc.mechanics.linear import dot
from wbc.robot import Robot
from wbc.sim.step.tables import Gears, Opened, SimState


class Drivetrain:
    """Gears of a robot as rows; all quantities at the motor outputs psi.

    Attributes:
        robot, gears: whose they are, and their numbers.
        rows: D^-1 on the driven columns (m, nv), psi_dot = rows @ v.
        forward, backward: eta_f, eta_b (m,).
        loose: (m,) whether the motor's output may leave the joint (stiffness or play).
        any_loose: whether any of them may.
    """

    def __init__(self, robot: Robot) -> None:
        """Collect the gears of `robot`."""
        self.robot, self.gears = robot, robot.transmission
        gears = self.gears
        self.rows = np.array(robot.motor_rows)
        # What these lose is up to their effects, which carry a state.
        kept = np.ones(gears.size, dtype=bool)
        kept[[gears.index(e.where) for e in robot.effects if "meshed" in e.acts_by]] = False
        self.forward = np.where(kept, gears.forward_efficiency, 1.0)
        self.backward = np.where(kept, gears.backward_efficiency, 1.0)
        self.loose = np.isfinite(gears.stiffness) | (gears.backlash > 0.0)
        self.any_loose = bool(self.loose.any())

    def tables(self) -> Gears:
        """Return the gears as tables for compiled loops."""
        gears, (m, nv), ratio = self.gears, self.rows.shape, self.gears.gear_ratio
        viscous = ratio**2 * gears.rotor_viscous_friction
        coulomb = np.abs(ratio) * gears.rotor_coulomb_friction
        numbers = ratio, gears.reflected_inertia, viscous, coulomb, 1.0 / self.forward
        flanks = gears.stiffness, gears.damping, gears.backlash
        arrays = map(np.array, (*numbers, self.backward, *flanks, self.rows))
        direct = not self.any_loose and np.array_equal(gears.topology, np.eye(m))
        row = np.where(direct & (self.backward >= 0.0), self.robot.actuated, -1)
        coupled = m if self.robot.rotors_turn_with_links else 0
        room = np.zeros((coupled, nv)), np.zeros((1, nv + m))
        return Gears._make((*arrays, row, self.loose, *room, self.any_loose))

    def motion(self, state: SimState) -> tuple[FloatArray, FloatArray]:
        """Return deflections (m,) [rad] and speeds (m,) [rad/s] of the motor outputs."""
        joint = self.rows @ state.velocity
        if not self.any_loose:
            return np.zeros(len(joint)), joint
        given = state.motor_velocity if len(state.motor_velocity) else joint
        deflection = state.deflection if len(state.deflection) else np.zeros(len(joint))
        return deflection, np.where(self.loose, given, joint)

    def rotors(self, state: SimState) -> tuple[FloatArray, FloatArray]:
        """Return angles (m,) [rad], speeds (m,) [rad/s] of the rotors, zero where joints are."""
        deflection, speed = self.motion(state)
        joint = self.gears.motor_from_joint @ state.position[self.robot.actuated_position]
        ratio = self.gears.gear_ratio
        return ratio * (joint + deflection), ratio * speed


@inner
def motor_speeds(gears: Gears, v: Row, loose: Row, speed: OutRow) -> None:
    """Write the speeds (m,) of the motor outputs at v (nv,); those of loose gears are `loose`."""
    for i in range(len(speed)):
        speed[i] = loose[i] if gears.yields[i] else dot(v, gears.rows[i])


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
        law, rubs = laws[i], step * gears.coulomb[i]
        brought = step * gears.ratio[i] * plant.end.torque[i] + gears.inertia[i] * speed[i]
        law[0], law[1], law[2] = brought - rubs, brought + rubs, gears.inertia[i]
        law[2] += step * gears.viscous[i]
        law[3], law[4], law[5], law[6] = forces.inverse[i], forces.backward[i], 0.0, 0.0
        rest, slowness = forces.gears[i, 0], forces.gears[i, 1]
        if rest > 0.0:
            share = near_rest(dot(plant.end.speed, gears.rows[i]), rest, slowness)
            law[3], law[4] = law[3] / (1.0 - share), law[4] / (1.0 + share)
        if gears.row[i] >= 0:
            law[5] = step * forces.friction[gears.row[i]]
        law[7], law[8] = np.inf, 0.0


@inner
def rotor_brings(gears: Gears, which: int, brought: float, law: OutRow) -> None:
    """Write what a rotor brings along an impact's path, in its direction and in the other one.

    Ending up in the other direction it brings eta_f eta_b M w_before, where a step, which only
    knows its end, takes all of M w_before. So the law is monotone, whatever is brought.

    Args:
        gears, which: all of them, and the number of this one.
        brought: M w_before, less what the housing takes [N m s].
        law: (9,) whose first two numbers are written, see `RowSystem`.
    """
    kept = max(gears.backward[which], 0.0) / gears.inverse[which] * brought
    law[0] = brought if brought > 0.0 else kept
    law[1] = brought if brought < 0.0 else kept


@inner
def rotor_energy(gears: Gears, v: Row, motor: Row) -> float:
    """Return what rotors add to the kinetic energy at v (nv,), with motor outputs at (m,)."""
    energy = 0.0
    for g in range(len(motor)):
        energy += 0.5 * gears.inertia[g] * motor[g] * motor[g]
        if len(gears.coupling):
            energy += motor[g] * dot(v, gears.coupling[g])
    return energy
