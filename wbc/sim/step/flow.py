"""One smooth part of a step: no barrier is reached in it (Moreau's midpoint scheme).

q_m = q + h/2 v;  H(q_m)(v' - v) = h (forces at q_m) + row impulses;  q' = q_m + h/2 v'
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import SimulationError
from wbc.sim.energy.energy_flow import EnergyFlow
from wbc.sim.energy.flow_energy import Transit, flow_energy
from wbc.sim.ground.barriers import TOUCH, ClosedRows
from wbc.sim.ground.contact_rows import ContactRows, world_impulse
from wbc.sim.laws.coupling import (
    COUPLING_FAILED,
    COUPLING_ROUNDS,
    COUPLING_TOLERANCE,
    StepCoupling,
    step_coupling,
)
from wbc.sim.laws.gear_rows import GearRows, gear_rows
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.setup import Setup
from wbc.sim.solve.reduced import NOT_POSITIVE
from wbc.sim.solve.solution import StepSolution
from wbc.sim.solve.solver import solve_program
from wbc.sim.state import SimState
from wbc.sim.step.forces import EffectForces, effect_forces
from wbc.sim.step.program import StepProgram

_RETURN = 1e-3
"""Time [s] in which an overlap is taken back at the earliest."""


@dataclass(frozen=True, eq=False)
class Flow:
    """What happened in one smooth part.

    Attributes:
        state: at its end.
        gap: (2 j + k,) at its end, to first order.
        contacts: rows of all contact points.
        touching: (c,) indices of the closed ones.
        transit: how the gears passed.
    """

    state: SimState
    gap: FloatArray
    contacts: ContactRows
    touching: IntArray
    transit: Transit

    @cached_property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return world_impulse(self.contacts, self.touching, self.solution)

    @property
    def mesh_impulse(self) -> FloatArray:
        """T (m,) [N m s]."""
        return self.transit.mesh

    @property
    def rotor_impulse(self) -> FloatArray:
        """Impulse (m,) [N m s] delivered on the rotors."""
        return self.transit.step * self.transit.forces.rotor

    @property
    def solution(self) -> StepSolution:
        """Of the step program."""
        return self.transit.solution

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses."""
        return flow_energy(self.transit)


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
        state: with known `closed`, and with the memory of its effects.
        command: (m,) rotor torque [N m].
        step: h [s].
        external: generalised force (nv,), None for none.
    """
    model, data, barriers = setup.space.model, setup.space.data, setup.barriers
    velocity, half = state.velocity, 0.5 * step
    middle = pin.integrate(model, state.position, half * velocity)
    at = middle, velocity, state.time + half
    forces = effect_forces(setup.robot, at, command, state.memory, step)
    coupling = step_coupling(setup.robot, setup.space, middle, velocity)
    pin.crba(model, data, middle, pin.Convention.WORLD)
    force = forces.joint - pin.nonLinearEffects(model, data, middle, velocity)
    if external is not None:
        force += external
    clearance = barriers.clearance(middle)
    contacts = barriers.contact_rows(clearance)
    held = barriers.closed_rows(state.closed, contacts, _opening(clearance.gap, step))
    motor = MotorMotion.of(setup.drive, state)
    problem = _Problem(setup, state, motor, step, forces, force, held)
    gears, places, solution = _solve_released(problem, coupling)
    after = solution.velocity
    mesh, speed = gears.passed(solution)
    motor_after = motor.after(setup.drive, after, speed, step)
    end_gap = clearance.gap + half * barriers.approach(contacts, after)
    following = SimState(
        pin.integrate(model, middle, half * after),
        after,
        state.time + step,
        _still_closed(state.closed, end_gap, solution.normal_impulse),
        setup.layout.store(solution.impulse, places),
        motor_after.deflection,
        motor_after.speed,
        forces.memory,
    )
    transit = Transit(
        setup.drive, velocity, motor, motor_after, mesh, solution, gears, forces, external, step
    )
    return Flow(following, end_gap, contacts, held.which, transit)


def _opening(gap: FloatArray, step: float) -> FloatArray:
    """Return the lowest speed (2 j + k,) at which gaps (2 j + k,) may open over a step.

    A gap that is left may close within the step. An overlap is taken back no faster than in
    `_RETURN`: the rest of a step after a landing may last a nanosecond, in which even an overlap
    of half `TOUCH` would be an impact that throws the robot up.
    """
    return np.asarray(-gap / np.where(gap > 0.0, step, max(step, _RETURN)))


def _still_closed(closed: BoolArray, gap: FloatArray, pressed: FloatArray) -> BoolArray:
    """Return which barriers (2 j + k,) stay closed: those that are pressed, and those in touch."""
    if min(pressed.tolist(), default=1.0) > 0.0:
        return closed
    after = closed.copy()
    after[closed] = (gap[closed] <= TOUCH) | (pressed > 0.0)
    return after


_Solved: TypeAlias = tuple[GearRows, IntArray, StepSolution]
"""The gears' rows, the places of all rows in `SimState.impulse`, and the solution."""


@dataclass(frozen=True, eq=False, slots=True)
class _Problem:
    """Everything that stays the same while the rows of one part are solved."""

    setup: Setup
    state: SimState
    motor: MotorMotion
    step: float
    forces: EffectForces
    force: FloatArray
    held: ClosedRows


def _solve_released(problem: _Problem, coupling: StepCoupling | None) -> _Solved:
    """Solve the step, letting go of gears that would pull on a flank of their play."""
    drive = problem.setup.drive
    released = np.zeros(drive.size, dtype=bool)
    for _ in range(drive.size + 1):
        if coupling is None:
            solved = _solve(problem, released, None, None)
        else:
            solved = _solve_coupled(problem, released, coupling)
        if not drive.any_loose:
            break
        gears, _, solution = solved
        pulling = gears.side[gears.engaged] * solution.impulse[: len(gears.engaged)] < 0.0
        if not pulling.any():
            break
        released[gears.engaged[pulling]] = True
    return solved


def _solve_coupled(problem: _Problem, released: BoolArray, coupling: StepCoupling) -> _Solved:
    """Repeat the step with the rotor coupling of its last iterate until the velocity repeats."""
    drive, velocity = problem.setup.drive, problem.state.velocity
    last = velocity
    for _ in range(COUPLING_ROUNDS):
        change = last - velocity
        links = coupling.inertia.T @ (drive.rows @ change) + problem.step * coupling.link_bias
        rotors = coupling.inertia @ change + problem.step * coupling.rotor_bias
        solved = _solve(problem, released, links, rotors)
        reached = solved[2].velocity
        moved = np.abs(reached - last).max(initial=0.0)
        if moved <= COUPLING_TOLERANCE * (1.0 + np.abs(last).max(initial=0.0)):
            return solved
        last = reached
    raise SimulationError(COUPLING_FAILED)


def _solve(
    problem: _Problem,
    released: BoolArray,
    on_links: FloatArray | None,
    on_rotors: FloatArray | None,
) -> _Solved:
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
    gears = gear_rows(setup.drive, driven, problem.forces.friction, step, motor, released)
    places = setup.layout.places(gears, problem.held)
    guess = setup.layout.recall(state.impulse, places)
    free = state.velocity + change
    program = StepProgram(inertia, free, gears.elements, problem.held.unilateral)
    try:
        return gears, places, solve_program(program, guess)
    except SimulationError:
        resting = problem.held.unilateral.without_opening()
        if resting is None:
            raise
    # A point that friction jams cannot be opened, not even to take back a drift: it rests.
    program = StepProgram(inertia, free, gears.elements, resting)
    return gears, places, solve_program(program, guess)
