"""One smooth part of a step: no barrier is reached in it (Moreau's midpoint scheme).

q_m = q + h/2 v;  H(q_m)(v' - v) = h (forces at q_m) + row impulses;  q' = q_m + h/2 v'
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import SimulationError
from wbc.robot import Motion
from wbc.sim.barriers import TOUCH
from wbc.sim.coupling import (
    COUPLING_FAILED,
    COUPLING_ROUNDS,
    COUPLING_TOLERANCE,
    StepCoupling,
    step_coupling,
)
from wbc.sim.energy import EnergyFlow
from wbc.sim.flow_energy import flow_energy
from wbc.sim.forces import EffectForces, effect_forces
from wbc.sim.gear_rows import GearRows, gear_rows
from wbc.sim.ground import ContactRows, world_impulse
from wbc.sim.motor_motion import MotorMotion
from wbc.sim.program import StepProgram, Unilateral
from wbc.sim.reduced import NOT_POSITIVE
from wbc.sim.setup import Setup
from wbc.sim.solution import StepSolution
from wbc.sim.solver import solve_program
from wbc.sim.state import SimState
from wbc.sim.warm_start import recall_impulse, row_places, store_impulse


@dataclass(frozen=True, eq=False, slots=True)
class Flow:
    """What happened in one smooth part.

    Attributes:
        state: at its end.
        gap: (2 j + k,) at its end, to first order.
        contact_impulse: (k, 3) [N s], world.
        mesh_impulse: T (m,) [N m s].
        rotor_impulse: (m,) [N m s] delivered on the rotors.
        energy: work and losses.
        solution: of the step program.
    """

    state: SimState
    gap: FloatArray
    contact_impulse: FloatArray
    mesh_impulse: FloatArray
    rotor_impulse: FloatArray
    energy: EnergyFlow
    solution: StepSolution


def flow(
    setup: Setup,
    state: SimState,
    command: FloatArray,
    step: float,
    external: FloatArray | None,
) -> Flow:
    """Advance by `step` [s] with the barriers that are closed at its start.

    Args:
        setup: the plant's.
        state: with known `closed`.
        command: (m,) rotor torque [N m].
        step: h [s].
        external: generalised force (nv,), None for none.
    """
    model, data, barriers = setup.space.model, setup.space.data, setup.barriers
    velocity = state.velocity
    middle = pin.integrate(model, state.position, 0.5 * step * velocity)
    motion = Motion(middle, velocity, time=np.asarray(state.time + 0.5 * step))
    forces = effect_forces(setup.robot, motion, command)
    coupling = step_coupling(setup.robot, setup.space, middle, velocity)
    pin.crba(model, data, middle, pin.Convention.WORLD)
    force = forces.joint - pin.nonLinearEffects(model, data, middle, velocity)
    if external is not None:
        force += external
    clearance = barriers.clearance(middle)
    unilateral, contacts, limits = barriers.rows(
        state.closed, clearance.normal, clearance.gap / -step
    )
    motor = MotorMotion.of(setup.drive, state)
    problem = _Problem(setup, state, motor, step, forces, force, unilateral, contacts, limits)
    gears, solution = _solve_released(problem, coupling)
    energy, mesh, motor_after = flow_energy(
        setup.drive, velocity, motor, solution, gears, forces, external, step
    )
    after = solution.velocity
    end_gap = clearance.gap + 0.5 * step * barriers.approach(clearance.normal, after)
    normal_impulse = solution.normal_impulse
    closed = state.closed.copy()
    closed[state.closed] = (end_gap[state.closed] <= TOUCH) | (normal_impulse > 0.0)
    world = world_impulse(
        contacts, normal_impulse[len(limits) :], solution.tangent_impulse, barriers.contacts
    )
    following = SimState(
        pin.integrate(model, middle, 0.5 * step * after),
        after,
        state.time + step,
        closed,
        store_impulse(setup, solution.impulse, row_places(setup, gears, contacts, limits)),
        motor_after.deflection,
        motor_after.speed,
    )
    return Flow(following, end_gap, world, mesh, step * forces.rotor, energy, solution)


@dataclass(frozen=True, eq=False, slots=True)
class _Problem:
    """Everything that stays the same while the rows of one part are solved."""

    setup: Setup
    state: SimState
    motor: MotorMotion
    step: float
    forces: EffectForces
    force: FloatArray
    unilateral: Unilateral
    contacts: ContactRows
    limits: IntArray


def _solve_released(
    problem: _Problem, coupling: StepCoupling | None
) -> tuple[GearRows, StepSolution]:
    """Solve the step, letting go of gears that would pull on a flank of their play."""
    drive = problem.setup.drive
    released = np.zeros(drive.size, dtype=bool)
    for _ in range(drive.size + 1):
        if coupling is None:
            gears, solution = _solve(problem, released, None, None)
        else:
            gears, solution = _solve_coupled(problem, released, coupling)
        if not drive.any_loose:
            break
        pulling = gears.side[gears.engaged] * solution.impulse[: len(gears.engaged)] < 0.0
        if not pulling.any():
            break
        released[gears.engaged[pulling]] = True
    return gears, solution


def _solve_coupled(
    problem: _Problem, released: BoolArray, coupling: StepCoupling
) -> tuple[GearRows, StepSolution]:
    """Repeat the step with the rotor coupling of its last iterate until the velocity repeats."""
    drive, velocity = problem.setup.drive, problem.state.velocity
    last = velocity
    for _ in range(COUPLING_ROUNDS):
        change = last - velocity
        links = coupling.inertia.T @ (drive.rows @ change) + problem.step * coupling.link_bias
        rotors = coupling.inertia @ change + problem.step * coupling.rotor_bias
        gears, solution = _solve(problem, released, links, rotors)
        moved = np.abs(solution.velocity - last).max(initial=0.0)
        if moved <= COUPLING_TOLERANCE * (1.0 + np.abs(last).max(initial=0.0)):
            return gears, solution
        last = solution.velocity
    raise SimulationError(COUPLING_FAILED)


def _solve(
    problem: _Problem,
    released: BoolArray,
    on_links: FloatArray | None,
    on_rotors: FloatArray | None,
) -> tuple[GearRows, StepSolution]:
    """Solve the step once, less the impulses (nv,) and (m,) that the rotor coupling takes."""
    setup, state, step, motor = problem.setup, problem.state, problem.step, problem.motor
    inertia = setup.space.data.M.copy()
    push = step * problem.force
    driven = step * (setup.drive.ratio * problem.forces.rotor)
    if on_links is not None and on_rotors is not None:
        push = push - on_links
        driven = driven - on_rotors
    _, change, info = lapack.dposv(inertia, push)
    if info != 0:
        raise SimulationError(NOT_POSITIVE)
    gears = gear_rows(
        setup.drive,
        driven,
        problem.forces.friction,
        step,
        (motor.speed, motor.relative, motor.deflection),
        released,
    )
    places = row_places(setup, gears, problem.contacts, problem.limits)
    guess = recall_impulse(setup, state.impulse, places)
    program = StepProgram(inertia, state.velocity + change, gears.elements, problem.unilateral)
    return gears, solve_program(program, guess)
