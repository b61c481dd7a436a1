"""The commands of ticks that have a solution."""

from __future__ import annotations

from time import perf_counter

from wbc.control.command import Command, Status
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.level import Answer, GearState
from wbc.control.torque.gears import GearLaw, gear_directions
from wbc.control.torque.motors import Motors
from wbc.robot import Motion


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
        start: float,
    ) -> Command:
        """Return the command.

        Args:
            program: the last program of the tick.
            answer: its solution, the torques, and how usable they are.
            gears: what the directions were judged by.
            motion: the state.
            start: when the tick began, by `perf_counter` [s].
        """
        found, (torque, mesh, exact), (status, message) = answer
        forces = program.forces_of(found.solution.x)
        consistent = exact or self._law.consistent(
            gear_directions(found.output, gears.sigma), found.output, mesh
        )
        drive = self._motors.to_drive(motion, torque)
        elapsed = perf_counter() - start
        if self._deadline is not None and elapsed > self._deadline:
            status = Status.LATE
            message = f"{1e3 * elapsed:.2f} ms of {1e3 * self._deadline:.2f} ms."
        return Command.of(
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
            tick_time=perf_counter() - start,
            rounds=found.rounds,
            iterations=found.iterations,
            solution=found.solution,
            refused=None,
        )
