"""The commands of ticks that have a solution."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import NamedTuple

from wbc.arrays import FloatArray
from wbc.control.command import Command, Status
from wbc.control.drivetrain import GearModel, joint_targets
from wbc.control.gears import gear_directions
from wbc.control.qp.level import SolvedLevel
from wbc.control.qp.program import Program
from wbc.control.tick import DRIVE, MESH, OUTPUT, SIGMA, TORQUE_ROW, TURNING
from wbc.robot import Motion, Robot


class ExpectedProspect(NamedTuple):
    """What the solution of a tick leads to.

    Attributes:
        robot: the robot.
        program: that was solved.
        block: its results, with copies of q and v, which the caller may overwrite meanwhile.
        dt: time until the next tick [s].
    """

    robot: Robot
    program: Program
    block: FloatArray
    dt: float

    def forces(self) -> Mapping[str, FloatArray]:
        """Return the force of every active contact."""
        program = self.program
        return program.contacts.wrenches(program.forces_of(self.block[program.at.x]))

    def targets(self) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the driven joints (m,) after the time step."""
        at, block = self.program.at, self.block
        state = block[at.position], block[at.velocity]
        return joint_targets(self.robot, state, block[at.x][: self.program.nv], self.dt)


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
    block, program, found, gears = answer.block, answer.level.program, answer.found, answer.gears
    (status, message), output, mesh, sigma = (
        answer.verdict,
        gears[OUTPUT],
        gears[MESH],
        gears[SIGMA],
    )
    exact = answer.exact
    if not exact:
        exact = drivetrain.law.consistent(gear_directions(output, sigma), output, mesh)
    drive = gears[DRIVE]
    if drivetrain.drives_differ or not answer.exact:
        drive = drivetrain.to_drive(motion, gears[TORQUE_ROW])
    elapsed = perf_counter() - start
    if deadline is not None and elapsed > deadline:
        status, message = Status.LATE, f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
    return Command.of(
        rotor_torque=drive,
        acceleration=block[program.at.x][: program.nv],
        consistent=exact,
        output_torque=output,
        mesh_torque=mesh,
        expected_speed=gears[TURNING],
        certainty=sigma,
        status=status,
        message=message,
        solve_time=answer.time if found is None else found.solve_time,
        tick_time=elapsed,
        rounds=1 if found is None else found.rounds,
        iterations=0 if found is None else found.iterations,
        solution=answer.solution,
        prospect=ExpectedProspect(drivetrain.robot, program, block, dt),
        refused=None,
        passed=answer.passed,
    )
