"""The commands of ticks that have a solution."""

from __future__ import annotations

from time import perf_counter
from typing import NamedTuple

from wbc.control.command import Command, Status
from wbc.control.gears import GearLaw, gear_directions
from wbc.control.level import Answer, GearState
from wbc.control.motors import Motors
from wbc.control.program import ContactForceProgram
from wbc.robot import Motion


class Outcome(NamedTuple):
    """A usable solution with the torques that realise it.

    Attributes:
        program: the last program of the tick.
        answer: its solution, the torques, and how usable they are.
        gears: what the directions were judged by.
        start: when the tick began, by `perf_counter` [s].
        deadline: [s] that the tick may take before it is late, None for no deadline.
    """

    program: ContactForceProgram
    answer: Answer
    gears: GearState
    start: float
    deadline: float | None

    def command(self, law: GearLaw, motors: Motors, motion: Motion) -> Command:
        """Return the command.

        Args:
            law: what judges whether torques and directions agree.
            motors: what turns the torques into drive commands.
            motion: the state.
        """
        program, gears = self.program, self.gears
        found, (torque, mesh, exact), (status, message) = self.answer
        forces = found.solution.x[program.nv :] * program.force_scale
        consistent = exact or law.consistent(
            gear_directions(found.output, gears.sigma), found.output, mesh
        )
        drive = motors.to_drive(motion, torque)
        elapsed = perf_counter() - self.start
        if self.deadline is not None and elapsed > self.deadline:
            status = Status.LATE
            message = f"{1e3 * elapsed:.2f} ms of {1e3 * self.deadline:.2f} ms."
        return Command(
            rotor_torque=drive,
            acceleration=found.acceleration,
            forces=program.contacts.wrenches(forces),
            consistent=consistent,
            output_torque=found.output,
            mesh_torque=mesh,
            expected_speed=gears.speed,
            certainty=gears.sigma,
            status=status,
            message=message,
            solve_time=found.solve_time,
            tick_time=perf_counter() - self.start,
            rounds=found.rounds,
            solution=found.solution,
        )
