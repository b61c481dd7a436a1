"""One smooth part of a step: no barrier is hit in it (Moreau's midpoint scheme).

q_m = q + h/2 v;  H(q_m)(v' - v) = h (forces at q_m) + row impulses;  q' = q_m + h/2 v'

On a free base v is the momentum's at each of the three places (`flight`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from math import isfinite
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.sim.energy.energy_flow import EnergyFlow
from wbc.sim.energy.flow_energy import Transit, flow_energy
from wbc.sim.ground.barriers import TOUCH
from wbc.sim.ground.contact_rows import world_impulse
from wbc.sim.inner.inner import Ended, Inner
from wbc.sim.laws.coupling import StepCoupling, step_coupling
from wbc.sim.laws.gear_rows import GearRows
from wbc.sim.laws.grip import Grip
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.setup import Setup
from wbc.sim.solve.reduced import blown_up, reduce_program
from wbc.sim.solve.solution import StepSolution
from wbc.sim.state import SimState
from wbc.sim.step.arrival import arrive
from wbc.sim.step.flight import Middle, standing_at, to_middle
from wbc.sim.step.forces import EffectForces, effect_forces
from wbc.sim.step.part_program import PartProgram, problem_of, program_of, solve_gripped

_MESH_ROUNDS = 40
_MESH_TOLERANCE = 1e-9  # of the torque that a gear carries; steps are solved to 1e-10
# Change of what a gear carries per change of what its loss assumes: below it lies a loss of 95 % of
# the power forward, above it one of 95 % backward; beyond them is rounding.
_MESH_SLOPES = (-19.0, 0.95)


@dataclass(frozen=True, eq=False, slots=True)
class PlainEnd:
    """What `Ended` holds too, of a part that compiled loops do not know."""

    gap: FloatArray
    overlap: FloatArray
    contact_impulse: FloatArray
    mesh_impulse: FloatArray


@dataclass(eq=False)
class Flow:
    """What happened in one smooth part.

    Attributes:
        state: at its end.
        landed: whether a barrier that is not closed is passed at its end.
        end: gaps, overlaps and impulses.
        forces: of the effects.
        step: h [s].
        details: returns how the gears passed; called when asked for.
    """

    state: SimState
    landed: bool
    end: Ended | PlainEnd
    forces: EffectForces
    step: float
    details: Callable[[], Transit]

    @property
    def gap(self) -> FloatArray:
        """(2 j + c,) at its end."""
        return self.end.gap

    @property
    def overlap(self) -> FloatArray:
        """(2 j + c,) depth [m, rad] beyond the plant's return speed; empty where none is left."""
        return self.end.overlap

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return self.end.contact_impulse

    @property
    def mesh_impulse(self) -> FloatArray:
        """T (m,) [N m s]."""
        return self.end.mesh_impulse

    @property
    def rotor_impulse(self) -> FloatArray:
        """Impulse (m,) [N m s] delivered on the rotors."""
        return self.step * self.forces.rotor

    @cached_property
    def transit(self) -> Transit:
        """How the gears passed."""
        return self.details()

    @property
    def solution(self) -> StepSolution:
        """Of the step program."""
        return self.transit.solution

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses."""
        return flow_energy(self.transit)


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


def flow(given: PartInput) -> Flow:
    """Advance by `given.step` with the barriers that are closed at its start."""
    found = _once(given)
    if given.setup.meshed:
        return _with_mesh(found, lambda mesh: _once(given._replace(mesh=mesh)))
    return found


def _once(given: PartInput) -> Flow:
    """Return the part for what effects take the gears to carry."""
    inner = given.setup.inner
    found = None if inner is None else _compiled(given, inner)
    return _plain(given) if found is None else found


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


def _compiled(given: PartInput, inner: Inner) -> Flow | None:
    """Return the part as the compiled loops find it; None where they do not."""
    setup, state, command, step, external, kept, mesh = given
    if setup.robot.effects:
        half = inner.to_middle(state, 0.5 * step)
        at = *inner.middle(half), state.time + 0.5 * step
        of_motor = setup.temperature, mesh
        forces = effect_forces(setup.robot, at, command, state.memory, step, *of_motor)
        drive = setup.moving(*at[:2]).drive if setup.varying else None
        found = inner.from_middle(state, half, forces, external, kept, step, drive)
    else:
        forces = EffectForces(setup.still, None, command, ())
        found = inner.part(state, forces, external, kept, step)
    if found is None:
        return None
    following = SimState(
        found.position,
        found.velocity,
        state.time + step,
        found.closed,
        found.impulse,
        setup.drive.zero,
        found.motor_speed,
        forces.memory,
    )
    details = partial(_rebuilt, given, forces, found)
    return Flow(following, found.landed, found, forces, step, details)


def _rebuilt(given: PartInput, forces: EffectForces, found: Ended) -> Transit:
    """Return how the gears passed a part that compiled loops solved.

    Its program is put together anew, without them: what the solution misses of its laws, and the
    energy of the part, are then checks of the loops.
    """
    setup, state, step, external = given.setup, given.state, given.step, given.external
    position, velocity, rate = found.middle
    setup = setup.moving(position, velocity)
    middle = standing_at(setup.bases, setup.space, position, velocity)
    problem = problem_of(setup, state, middle, rate, forces, external, given.kept, step, None)
    gears, places, program = program_of(problem, Grip.firm(setup.drive), None, None)
    reduced, impulse = reduce_program(program), found.impulse[places]
    solution = StepSolution(
        found.after, impulse, reduced.speeds(impulse), found.iterations, "newton", reduced
    )
    mesh, speed = gears.passed(solution)
    after = problem.motor.after(setup.drive, solution.velocity, speed, step)
    return _transit_of(problem, gears, solution, mesh, after, external)


def _plain(given: PartInput) -> Flow:
    """Return the part by arrays and every solver: loose gears, coupled rotors, any ground.

    The steps of docs/method/simulation-method.md in their order; `from_middle` in `wbc.sim.inner`
    is the same in compiled loops.
    """
    state, step, kept = given.state, given.step, given.kept
    # Forces, in the middle of the part.
    rate = _rate_at_start(given.setup, state)
    middle, forces = _forces_in_the_middle(given)
    setup = given.setup.moving(middle.position, middle.velocity)
    coupling = _coupling_at(setup, middle)
    # Barriers.
    problem = problem_of(setup, state, middle, rate, forces, given.external, kept, step, coupling)
    # Gear rows, program and solution.
    gears, places, solution = solve_gripped(problem)
    if not isfinite(solution.velocity.sum()):
        raise blown_up(setup.space.data.M, state.velocity)
    mesh, speed = gears.passed(solution)
    motor = problem.motor.after(setup.drive, solution.velocity, speed, step)
    # New state.
    closed, until = state.closed | kept, state.time + step
    end = arrive(setup, middle, solution, closed, problem.held, step, until)
    following = SimState(
        end.position,
        end.velocity,
        until,
        _still_closed(closed, end.gap, solution.normal_impulse),
        setup.layout.store(solution.impulse, places),
        _shifted(setup, motor.deflection, end.shift),
        motor.speed,
        forces.memory,
    )
    landed = bool(np.any(~closed & (end.gap < -TOUCH)))
    push = world_impulse(problem.held.contacts, setup.barriers.points, solution)
    # What the audit reads.
    transit = _transit_of(problem, gears, solution, mesh, motor, given.external)
    ended = PlainEnd(end.gap, end.overlap, push, mesh)
    return Flow(following, landed, ended, forces, step, lambda: transit)


def _forces_in_the_middle(given: PartInput) -> tuple[Middle, EffectForces]:
    """Return the middle of a part, where the workspace then stands, and the effects' forces."""
    setup, state, half = given.setup, given.state, 0.5 * given.step
    middle = to_middle(setup.bases, setup.space, state.position, state.velocity, half)
    at = middle.position, middle.velocity, state.time + half
    of_motor = setup.temperature, given.mesh
    forces = effect_forces(setup.robot, at, given.command, state.memory, given.step, *of_motor)
    return middle, forces


def _coupling_at(setup: Setup, middle: Middle) -> StepCoupling | None:
    """Return the inertial coupling of rotors and housings; the workspace stands there again."""
    space = setup.space
    coupling = step_coupling(setup.robot, space, middle.position, middle.velocity)
    if coupling is not None:
        pin.crba(space.model, space.data, middle.position, pin.Convention.WORLD)
    return coupling


def _shifted(setup: Setup, deflection: FloatArray, shift: FloatArray) -> FloatArray:
    """Return deflections (m,) after a shift (nv,) out of overlaps: motors stay where they are."""
    if not setup.drive.any_loose or not len(shift):
        return deflection
    return deflection - np.where(setup.drive.loose, setup.drive.rows @ shift, 0.0)


def _transit_of(
    problem: PartProgram,
    gears: GearRows,
    solution: StepSolution,
    mesh: FloatArray,
    motor: MotorMotion,
    external: FloatArray | None,
) -> Transit:
    """Return how the gears passed, whose meshes give `mesh` (m,) and whose motors then move."""
    setup, step = problem.setup, problem.step
    middle = problem.state.time + 0.5 * step
    ground = setup.barriers.ground_speed(problem.held, middle, middle)
    return Transit(
        setup.robot,
        setup.drive,
        problem.velocity,
        problem.motor,
        motor,
        mesh,
        solution,
        gears,
        problem.forces,
        external,
        step,
        ground,
    )


def _rate_at_start(setup: Setup, state: SimState) -> FloatArray:
    """Return the robot's speed along closed contacts at the start (2 j + c,), zero for all else."""
    barriers, rate = setup.barriers, np.zeros(setup.barriers.size)
    touching = state.closed.copy()
    touching[: barriers.limits] = False
    if touching.any():
        pin.crba(setup.space.model, setup.space.data, state.position, pin.Convention.WORLD)
        clearance = barriers.clearance(state.position, state.time)
        held = barriers.rows(touching, clearance, rate)
        rate[touching] = held.turning(state.velocity)
    return rate


def _still_closed(closed: BoolArray, gap: FloatArray, pressed: FloatArray) -> BoolArray:
    """Return which barriers (2 j + c,) stay closed: those that are pressed, and those in touch."""
    if min(pressed.tolist(), default=1.0) > 0.0:
        return closed
    after = closed.copy()
    after[closed] = (gap[closed] <= TOUCH) | (pressed > 0.0)
    return after
