"""The commands of ticks that have a solution."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.command import Command, Status
from wbc.control.drivetrain import GearModel, joint_targets
from wbc.control.gears import consistent
from wbc.control.qp.level import SolvedLevel
from wbc.control.qp.problem import QPSolution
from wbc.control.tick import DRIVE, MESH, OUTPUT, SIGMA, TORQUE_ROW, TURNING
from wbc.robot import Motion, Robot


class ExpectedProspect(NamedTuple):
    """What the solution of a tick leads to: fields of `Command`, taken from the block of results.

    Attributes:
        robot: the robot.
        answer: of the tick, with copies of q and v, which the caller may overwrite meanwhile.
        dt: time until the next tick [s].
        slopes: of the mesh law (2, m), forward and backward, where limits bent the torques.
    """

    robot: Robot
    answer: SolvedLevel
    dt: float
    slopes: FloatArray | None

    @property
    def acceleration(self) -> FloatArray:
        """The expected qdd (nv,)."""
        program = self.answer.level.program
        return np.asarray(self.answer.block[program.at.x][: program.nv])

    @property
    def output_torque(self) -> FloatArray:
        """T (m,)."""
        return self.answer.row(OUTPUT)

    @property
    def mesh_torque(self) -> FloatArray:
        """t (m,)."""
        return self.answer.row(MESH)

    @property
    def expected_speed(self) -> FloatArray:
        """dpsi (m,)."""
        return self.answer.row(TURNING)

    @property
    def certainty(self) -> FloatArray:
        """sigma (m,)."""
        return self.answer.row(SIGMA)

    @property
    def consistent(self) -> bool:
        """Whether the mesh law allows the torques."""
        if self.slopes is None:
            return True
        return consistent(self.output_torque, self.mesh_torque, self.certainty, self.slopes)

    @property
    def solution(self) -> QPSolution:
        """Of the last program."""
        return self.answer.solution

    def forces(self) -> Mapping[str, FloatArray]:
        """Return the force of every active contact."""
        program = self.answer.level.program
        return program.contacts.wrenches(program.forces_of(self.answer.block[program.at.x]))

    def targets(self) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the driven joints (m,) after the time step."""
        at, block = self.answer.level.program.at, self.answer.block
        state = block[at.position], block[at.velocity]
        return joint_targets(self.robot, state, self.acceleration, self.dt)


def command_of(
    answer: SolvedLevel,
    drivetrain: GearModel,
    motion: Motion,
    dt: float,
    start: float,
    deadline: float | None,
) -> Command:
    """Return the command of a usable solution.

    Args:
        answer: the solution.
        drivetrain: what turns the torques into drive commands.
        motion: the state.
        dt: time until the next tick [s].
        start: when the tick began, by `perf_counter` [s].
        deadline: [s] that a tick may take before it is late, None for no deadline.
    """
    found, (status, message) = answer.found, answer.verdict
    drive, slopes = answer.row(DRIVE), None
    if not answer.exact:
        slopes = np.array([drivetrain.law.forward, drivetrain.law.backward])
    if drivetrain.differs or not answer.exact:
        drive = drivetrain.to_drive(motion, answer.row(TORQUE_ROW))
    elapsed = perf_counter() - start
    if deadline is not None and elapsed > deadline:
        status, message = Status.LATE, f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
    return Command.of(
        rotor_torque=drive,
        status=status,
        message=message,
        solve_time=answer.time if found is None else found.solve_time,
        tick_time=elapsed,
        rounds=1 if found is None else found.rounds,
        iterations=0 if found is None else found.iterations,
        prospect=ExpectedProspect(drivetrain.robot, answer, dt, slopes),
        refused=None,
        passed=answer.passed,
    )
