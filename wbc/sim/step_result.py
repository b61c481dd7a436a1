"""What one step of the plant returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.energy import EnergyFlow
from wbc.sim.flow import Flow
from wbc.sim.impact import Impact
from wbc.sim.solution import StepSolution
from wbc.sim.state import SimState


@dataclass(frozen=True, eq=False, slots=True)
class StepResult:
    """The next state and what led there.

    Attributes:
        state: at the end of the step.
        duration: dt [s].
        contact_impulse: (k, 3) [N s] on the robot, world axes, impacts excluded.
        mesh_torque: T (m,) [N m] after each mesh, mean over the step, impacts excluded.
        rotor_torque: (m,) [N m] that the drives delivered, mean over the step.
        impacts: those that happened in the step.
        energy: work and losses.
        solutions: of the step programs, one per part of the step.
    """

    state: SimState
    duration: float
    contact_impulse: FloatArray
    mesh_torque: FloatArray
    rotor_torque: FloatArray
    impacts: tuple[Impact, ...]
    energy: EnergyFlow
    solutions: tuple[StepSolution, ...]

    @property
    def contact_force(self) -> FloatArray:
        """Mean force (k, 3) [N] on the robot over the step, impacts included, world axes."""
        total = np.array(self.contact_impulse)
        for impact in self.impacts:
            total += impact.contact_impulse
        return np.asarray(total / self.duration)

    @staticmethod
    def joined(results: Sequence[StepResult]) -> StepResult:
        """Return several steps in a row as one."""
        duration = sum(result.duration for result in results)
        weights = np.array([result.duration for result in results]) / duration
        return StepResult(
            state=results[-1].state,
            duration=duration,
            contact_impulse=np.sum([r.contact_impulse for r in results], axis=0),
            mesh_torque=weights @ np.array([r.mesh_torque for r in results]),
            rotor_torque=weights @ np.array([r.rotor_torque for r in results]),
            impacts=tuple(impact for r in results for impact in r.impacts),
            energy=_total([r.energy for r in results]),
            solutions=tuple(solution for r in results for solution in r.solutions),
        )


def merged(dt: float, parts: Sequence[Flow], impacts: Sequence[Impact]) -> StepResult:
    """Return the result of a step of `dt` that was taken in parts."""
    flows = [part.energy for part in parts]
    hits = [EnergyFlow(impact_mesh=i.mesh_loss, impact=i.contact_loss) for i in impacts]
    if len(parts) == 1:
        contact, mesh = parts[0].contact_impulse, parts[0].mesh_impulse
        rotor = parts[0].rotor_impulse
    else:
        contact = np.sum([part.contact_impulse for part in parts], axis=0)
        mesh = np.sum([part.mesh_impulse for part in parts], axis=0)
        rotor = np.sum([part.rotor_impulse for part in parts], axis=0)
    return StepResult(
        state=parts[-1].state,
        duration=dt,
        contact_impulse=contact,
        mesh_torque=mesh / dt,
        rotor_torque=rotor / dt,
        impacts=tuple(impacts),
        energy=_total(flows + hits),
        solutions=tuple(part.solution for part in parts),
    )


def _total(flows: Sequence[EnergyFlow]) -> EnergyFlow:
    total = flows[0]
    for more in flows[1:]:
        total = total + more
    return total
