"""The commands of ticks that have a solution."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

from wbc.arrays import FloatArray
from wbc.control.command import Command, Status
from wbc.control.direction_search import Found
from wbc.control.inputs import Complaint
from wbc.control.motors import Motors
from wbc.control.program import ContactForceProgram
from wbc.robot import Motion


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """A usable solution with the torques that realise it.

    Attributes:
        program: the last program of the tick.
        found: its solution.
        verdict: how usable the solution is, and what is in its way.
        torque: N tau_phi (m,) [N m].
        mesh: t (m,) [N m] that enters the meshes.
        expected: motor speed (m,) [rad/s] that the directions were judged by.
        sigma: certainty (m,) of the directions.
        consistent: whether the mesh law allows the torques in those directions.
    """

    program: ContactForceProgram
    found: Found
    verdict: Complaint
    torque: FloatArray
    mesh: FloatArray
    expected: FloatArray
    sigma: FloatArray
    consistent: bool

    def command(
        self, motors: Motors, motion: Motion, start: float, deadline: float | None
    ) -> Command:
        """Return the command.

        Args:
            motors: what turns the torques into drive commands.
            motion: the state.
            start: when the tick began, by `perf_counter` [s].
            deadline: [s] that the tick may take before it is late, None for no deadline.
        """
        program, found, active = self.program, self.found, self.program.contacts
        forces = found.solution.x[program.nv :] * program.force_scale
        status, message = self.verdict
        elapsed = perf_counter() - start
        if deadline is not None and elapsed > deadline:
            status, message = Status.LATE, f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
        return Command(
            rotor_torque=motors.to_drive(motion, self.torque),
            acceleration=found.acceleration,
            forces={
                contact.name: contact.wrench(forces[rows])
                for contact, rows in zip(active.contacts, active.slices, strict=True)
            },
            consistent=self.consistent,
            output_torque=found.output,
            mesh_torque=self.mesh,
            expected_speed=self.expected,
            certainty=self.sigma,
            status=status,
            message=message,
            solve_time=found.solve_time,
            tick_time=perf_counter() - start,
            rounds=found.rounds,
            solution=found.solution,
        )
