"""The equation of motion of free gears with their modes held: smooth pieces and where they end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.robot import Robot
from wbc.sim.laws.drivetrain import Drivetrain, drivetrain
from wbc.sim.laws.elements import Elements, modes_at
from wbc.sim.solve.solver import solve_program
from wbc.sim.step.forces import EffectForces, effect_forces
from wbc.sim.step.program import StepProgram, Unilateral

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
        self.drive: Drivetrain = drivetrain(robot)
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
        forces = effect_forces(self.robot, (q, v, time), self.torque(time))
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
        return np.asarray(torque - piece.sign * drive.coulomb - drive.viscous * speed)

    def solve(
        self, time: float, state: FloatArray, piece: Piece
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return qdd (nv,), the joint-side torque T (m,) and the friction level for given modes."""
        drive, stuck = self.drive, piece.sign == 0.0
        inertia, force, forces, dry = self.terms(time, state)
        response = np.linalg.solve(inertia, np.column_stack((drive.rows.T, force)))
        own, free = drive.rows @ response[:, :-1], drive.rows @ response[:, -1]
        on_speed = np.where(stuck, 1.0, drive.inertia)
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
        torque = drive.ratio * forces.rotor - drive.viscous * (drive.rows @ state[self.nv :])
        scale = 1.0 + np.abs(free).max() + np.abs(torque).max() / drive.inertia.min(initial=1.0)
        shift = 1e3 * scale * moving
        elements = Elements(
            drive.rows,
            torque - drive.coulomb + drive.inertia * shift,
            torque + drive.coulomb + drive.inertia * shift,
            drive.inertia,
            drive.forward,
            drive.backward,
            dry,
            zero,
            drive.firm,
            zero,
        )
        none = np.zeros((0, self.nv))
        unilateral = Unilateral(none, none, none, np.zeros(0), np.zeros(0))
        ahead = free + np.linalg.pinv(drive.rows) @ shift
        solution = solve_program(StepProgram(inertia, ahead, elements, unilateral))
        slope = solution.reduced.slope
        modes = modes_at(elements, solution.impulse - slope * solution.speed, slope)
        return Piece(modes.sign, modes.gain)

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
        up = np.maximum(plus * inverse, plus * drive.backward) - (motor - drive.coulomb)
        down = (motor + drive.coulomb) - np.minimum(minus * inverse, minus * drive.backward)
        stuck = piece.sign == 0.0
        same = drive.backward == inverse
        return np.concatenate(
            (
                np.where(stuck, up, speed),
                np.where(stuck, down, np.where(same, 1.0, driving * mesh)),
            )
        )
