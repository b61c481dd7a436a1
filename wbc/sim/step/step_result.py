"""What one step of the plant returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.energy.audit import EnergyAudit
from wbc.sim.energy.energy_flow import EnergyFlow
from wbc.sim.energy.kinetic_energy import mechanical_energy
from wbc.sim.setup import Setup
from wbc.sim.solve.solution import StepSolution
from wbc.sim.state import SimState
from wbc.sim.step.events import StepEvent, events_of
from wbc.sim.step.flow import Flow
from wbc.sim.step.impact import Impact


@dataclass(frozen=True, eq=False)
class StepResult:
    """The next state and what led there.

    Attributes:
        state: at the end of the step.
        duration: dt [s].
        command: (m,) [N m] on the rotors that the motors took, within their bounds; as a mean where
            several steps are joined.
        parts: the smooth parts of the step; more than one where something landed in between.
        impacts: those that happened in the step.
        start: the state it started from.
        setup: the plant's.
    """

    state: SimState
    duration: float
    command: FloatArray
    parts: tuple[Flow, ...]
    impacts: tuple[Impact, ...]
    start: SimState
    setup: Setup

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes, impacts excluded."""
        return _sum([part.contact_impulse for part in self.parts])

    @property
    def contact_force(self) -> FloatArray:
        """Mean force (k, 3) [N] on the robot over the step, impacts included, world axes."""
        hits = [impact.contact_impulse for impact in self.impacts]
        return np.asarray(_sum([self.contact_impulse, *hits]) / self.duration)

    @property
    def mesh_torque(self) -> FloatArray:
        """T (m,) [N m] after each mesh, mean over the step, impacts excluded."""
        return np.asarray(_sum([part.mesh_impulse for part in self.parts]) / self.duration)

    @property
    def rotor_torque(self) -> FloatArray:
        """(m,) [N m] that the drives delivered, mean over the step."""
        return np.asarray(_sum([part.rotor_impulse for part in self.parts]) / self.duration)

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses."""
        total = EnergyFlow()
        for part in self.parts:
            total = total + part.energy
        for impact in self.impacts:
            lost = {"impact_mesh": impact.mesh_loss, "impact": impact.contact_loss}
            total = total + EnergyFlow(ground=impact.ground_work, **lost)
        return total

    @cached_property
    def balance(self) -> EnergyAudit:
        """Work in, energy stored, losses, and what they do not close by."""
        stored = mechanical_energy(self.setup, self.state)
        return EnergyAudit(self.energy, stored - mechanical_energy(self.setup, self.start))

    @cached_property
    def events(self) -> tuple[StepEvent, ...]:
        """Energy that the step made, overlaps that are left; empty in a good step."""
        return events_of(self.setup, self.parts, self.impacts, self.balance)

    @property
    def solutions(self) -> tuple[StepSolution, ...]:
        """Of the step programs, one per part of the step."""
        return tuple(part.solution for part in self.parts)

    @staticmethod
    def joined(results: Sequence[StepResult]) -> StepResult:
        """Return several steps in a row as one."""
        duration = sum(result.duration for result in results)
        return StepResult(
            state=results[-1].state,
            duration=duration,
            command=_sum([result.duration / duration * result.command for result in results]),
            parts=tuple(part for result in results for part in result.parts),
            impacts=tuple(impact for result in results for impact in result.impacts),
            start=results[0].start,
            setup=results[0].setup,
        )


def _sum(several: Sequence[FloatArray]) -> FloatArray:
    total = several[0]
    for more in several[1:]:
        total = total + more
    return total
