"""One smooth part of a step as Python sees it: effects, coupling, the compiled part, its energy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.sim.energy import EnergyFlow
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
from wbc.sim.step.books import CONTACT, FRICTION, GEAR, MESH, MISSED, MOTOR, ROTOR
from wbc.sim.step.core import Ended
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.program import StepSolution

_MESH_ROUNDS = 40
_MESH_TOLERANCE = 1e-9  # of the torque that a gear carries; steps are solved to 1e-10
# Change of what a gear carries per change of what its loss assumes: below it lies a loss of 95 % of
# the power forward, above it one of 95 % backward; beyond them is rounding.
_MESH_SLOPES = (-19.0, 0.95)


class PartInput(NamedTuple):
    """What one smooth part starts from.

    Attributes:
        setup: the plant's.
        state: with known `closed`, and with the memory of its effects.
        command: (m,) rotor torque [N m].
        step: h [s].
        external: generalised force (nv,), None for none.
        kept: (2 j + c,) barriers that may close within the part, without a bounce.
        mesh: (m,) [N m] that effects take the gears to carry, None for what they remember.
    """

    setup: Setup
    state: SimState
    command: FloatArray
    step: float
    external: FloatArray | None
    kept: BoolArray
    mesh: FloatArray | None = None


@dataclass(eq=False)
class Flow:
    """What happened in one smooth part.

    Attributes:
        state: at its end.
        end: gaps, overlaps, impulses, work and losses.
        forces: of the effects.
        given: what it started from.
    """

    state: SimState
    end: Ended
    forces: EffectForces
    given: PartInput

    @property
    def step(self) -> float:
        """h [s]."""
        return self.given.step

    @property
    def landed(self) -> bool:
        """Whether a barrier that is not closed is passed at its end."""
        return self.end.landed

    @property
    def missed(self) -> float:
        """Speed [m/s, rad/s] by which a passive end misses the laws, else zero."""
        return float(self.end.books[MISSED])

    @property
    def gap(self) -> FloatArray:
        """(2 j + c,) at its end."""
        return self.end.gap

    @property
    def overlap(self) -> FloatArray:
        """(2 j + c,) depth [m, rad] beyond the plant's return speed; empty where none is left."""
        return self.end.depth if self.end.left else self.end.depth[:0]

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return self.end.pushes.reshape(-1, 3)

    @property
    def mesh_impulse(self) -> FloatArray:
        """T (m,) [N m s]."""
        return self.end.mesh_impulse

    @property
    def rotor_impulse(self) -> FloatArray:
        """Impulse (m,) [N m s] delivered on the rotors."""
        return self.step * self.forces.rotor

    @cached_property
    def solution(self) -> StepSolution:
        """Of the step program, which is put together and solved again."""
        setup, state, _, step, external, kept, _ = self.given
        if setup.waits:
            setup.tell_coupling(self.end.before, self.end.speed)
            setup.tell_losses(self.end.before, self.end.speed)
        found = setup.core.solution(state, self.forces, external, kept, step, self.end)
        setup.forget_losses()
        return found

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses.

        Effects that store energy of their own have lines of their own (`Effect.memory_energy`).
        """
        setup, state, _, step, external, _, _ = self.given
        books, forces = self.end.books.tolist(), self.forces
        motor, stores, work, outer = books[MOTOR], EnergyFlow(), 0.0, 0.0
        joint = self.end.force if external is None else self.end.force - external
        if forces.kept_joint is not None and forces.kept_rotor is not None and forces.stores:
            joint = joint - forces.kept_joint
            before = setup.drive.motion(state)[1]
            turned = 0.5 * step * setup.drive.ratio * (before + self.end.motor_speed)
            motor -= float(forces.kept_rotor @ turned)
            stores = _stores(setup, forces)
        if external is not None or setup.robot.effects:
            mean = 0.5 * (self.end.speed + self.end.after)
            work = float(step * (joint @ mean))
            outer = 0.0 if external is None else float(step * (external @ mean))
        return EnergyFlow(
            motor=motor,
            external=outer,
            effects=work,
            reloaded=stores.reloaded,
            bent=stores.bent,
            mesh=books[MESH],
            rotor_friction=books[ROTOR],
            gear_damping=books[GEAR],
            joint_friction=books[FRICTION],
            bristles=stores.bristles,
            contact=books[CONTACT],
        )


def _stores(setup: Setup, forces: EffectForces) -> EnergyFlow:
    """Return where the work went that effects with a store of their own took."""
    total = EnergyFlow()
    for effect, motion in forces.stores:
        found = effect.memory_energy(setup.robot, motion)
        if found is not None:
            total = total + EnergyFlow(
                reloaded=found.reloaded, bent=found.stored, bristles=found.lost
            )
    return total


def flow(given: PartInput) -> Flow:
    """Advance by `given.step` with the barriers that are closed at its start.

    Raises:
        SimulationError: the part has no solution, or several.
    """
    found = _once(given)
    if given.setup.meshed:
        return _with_mesh(found, lambda mesh: _once(given._replace(mesh=mesh)))
    return found


def _with_mesh(first: Flow, solve: Callable[[FloatArray], Flow]) -> Flow:
    """Return the part in which effects see the torque that the gears then carry.

    Secant steps of each gear alone, from what its effect remembers of the step before: what a gear
    carries is nearly linear in what it is taken to carry, and other gears change it little.
    """
    taken = first.mesh_impulse / first.step
    miss, change, slope = np.zeros((3, len(taken)))
    for _ in range(_MESH_ROUNDS):
        found = solve(taken)
        carried = found.mesh_impulse / found.step
        before, miss = miss, carried - taken
        if np.all(np.abs(miss) <= _MESH_TOLERANCE * (1.0 + np.abs(carried))):
            break
        moved = change != 0.0
        ratio = (miss - before) / np.where(moved, change, 1.0)
        slope = np.where(moved, np.clip(1.0 + ratio, *_MESH_SLOPES), slope)
        change = miss / (1.0 - slope)
        taken = taken + change
    return found


def _once(given: PartInput) -> Flow:
    """Return the part for what effects take the gears to carry."""
    setup, state, command, step, external, kept, mesh = given
    core = setup.core
    if setup.waits:
        position, velocity = core.to_middle(state, 0.5 * step)
        at, of_motor = (position, velocity, state.time + 0.5 * step), (setup.temperature, mesh)
        forces = setup.effects.forces(at, command, state.memory, step, *of_motor)
        setup.tell_losses(position, velocity)
        setup.tell_coupling(position, velocity)
    else:
        forces = EffectForces(setup.still, None, setup.effects.delivered(command), ())
    try:
        found = core.part(state, setup.waits, forces, external, kept, step)
    finally:
        setup.forget_losses()  # impacts, and whatever comes next
    following = SimState(
        found.position,
        found.velocity,
        state.time + step,
        found.closed,
        found.impulse,
        found.deflection,
        found.motor_speed,
        forces.memory,
    )
    return Flow(following, found, forces, given)
