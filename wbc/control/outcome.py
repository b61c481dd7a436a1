"""The commands of ticks that have a solution."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import NamedTuple

from wbc.arrays import FloatArray
from wbc.control.command import Command, Status
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.level import Answer
from wbc.control.program.usual_tick import Passed, UsualTick
from wbc.control.safety.inputs import Complaint
from wbc.control.torque.gears import GearLaw, GearState, gear_directions
from wbc.control.torque.motors import Motors
from wbc.robot import Motion


class ExpectedProspect(NamedTuple):
    """What the solution of a tick leads to.

    Attributes:
        program: that was solved.
        x: its solution (n,).
        motors: what places the driven joints.
        state: copies of q (nq,) and v (nv,), which the caller may overwrite meanwhile.
        dt: time until the next tick [s].
    """

    program: ContactForceProgram
    x: FloatArray
    motors: Motors
    state: tuple[FloatArray, FloatArray]
    dt: float

    def forces(self) -> Mapping[str, FloatArray]:
        """Return the force of every active contact."""
        return self.program.contacts.wrenches(self.program.forces_of(self.x))

    def targets(self) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the driven joints (m,) after the time step."""
        return self.motors.targets(*self.state, self.x[: self.program.nv], self.dt)


_SOLVED = Status.SOLVED


class PassedProspect(NamedTuple):
    """What a usual tick leads to.

    Attributes:
        usual: what did it.
        block: its results.
        motors: what places the driven joints.
        dt: time until the next tick [s].
    """

    usual: UsualTick
    block: FloatArray
    motors: Motors
    dt: float

    def forces(self) -> Mapping[str, FloatArray]:
        """Return the force of every active contact."""
        program = self.usual.program
        return program.contacts.wrenches(program.forces_of(self.block[self.usual.at.x]))

    def targets(self) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the driven joints (m,) after the time step."""
        at, block = self.usual.at, self.block
        state = block[at.position], block[at.velocity]
        return self.motors.targets(*state, block[at.acceleration], self.dt)


class Outcome:
    """Makes commands of usable solutions."""

    def __init__(self, law: GearLaw, motors: Motors, deadline: float | None) -> None:
        """Take what does not change.

        Args:
            law: what judges whether torques and directions agree.
            motors: what turns the torques into drive commands.
            deadline: [s] that a tick may take before it is late, None for no deadline.
        """
        self._law, self._motors, self._deadline = law, motors, deadline

    def command(
        self,
        program: ContactForceProgram,
        answer: Answer,
        gears: GearState,
        motion: Motion,
        dt: float,
        start: float,
    ) -> Command:
        """Return the command.

        Args:
            program: the last program of the tick.
            answer: its solution, the torques, and how usable they are.
            gears: what the directions were judged by.
            motion: the state.
            dt: time until the next tick [s].
            start: when the tick began, by `perf_counter` [s].
        """
        found, (torque, mesh, exact), (status, message) = answer
        consistent = exact or self._law.consistent(
            gear_directions(found.output, gears.sigma), found.output, mesh
        )
        drive = self._motors.to_drive(motion, torque)
        state = motion.position.copy(), motion.velocity.copy()
        elapsed = perf_counter() - start
        if self._deadline is not None and elapsed > self._deadline:
            status, message = self._late(elapsed, self._deadline)
        return Command.of(
            rotor_torque=drive,
            acceleration=found.acceleration,
            consistent=consistent,
            output_torque=found.output,
            mesh_torque=mesh,
            expected_speed=gears.speed,
            certainty=gears.sigma,
            status=status,
            message=message,
            solve_time=found.solve_time,
            tick_time=elapsed,
            rounds=found.rounds,
            iterations=found.iterations,
            solution=found.solution,
            prospect=ExpectedProspect(program, found.solution.x, self._motors, state, dt),
            refused=None,
        )

    def usual(self, usual: UsualTick, passed: Passed, dt: float, start: float) -> Command:
        """Return the command of a usual tick, which no limit bends.

        Args:
            usual, passed: what did the tick, and what came of it.
            dt: time until the next tick [s].
            start: when the tick began, by `perf_counter` [s].
        """
        at, block, status, message = usual.at, passed.block, _SOLVED, ""
        prospect = PassedProspect(usual, block, self._motors, dt)
        solution = usual.solution(passed)
        elapsed = perf_counter() - start
        if self._deadline is not None and elapsed > self._deadline:
            status, message = self._late(elapsed, self._deadline)
        return Command.of(
            rotor_torque=block[at.drive],
            acceleration=block[at.acceleration],
            consistent=True,
            output_torque=block[at.output],
            mesh_torque=block[at.mesh],
            expected_speed=block[at.turning],
            certainty=block[at.sigma],
            status=status,
            message=message,
            solve_time=passed.time,
            tick_time=elapsed,
            rounds=1,
            iterations=passed.steps,
            solution=solution,
            prospect=prospect,
            refused=None,
        )

    @staticmethod
    def _late(elapsed: float, deadline: float) -> Complaint:
        """Return that a tick took longer than its deadline [s]."""
        return Status.LATE, f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
