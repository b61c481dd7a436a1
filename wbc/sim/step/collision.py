"""Taking an impact: barriers that are reached stop the robot at once."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import SimulationError
from wbc.sim.energy.kinetic_energy import kinetic_energy
from wbc.sim.ground.barriers import TOUCH
from wbc.sim.ground.contact_rows import ContactRows, world_impulse
from wbc.sim.laws.coupling import (
    COUPLING_FAILED,
    COUPLING_ROUNDS,
    COUPLING_TOLERANCE,
    StepCoupling,
    step_coupling,
)
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.setup import Setup
from wbc.sim.solve.solution import StepSolution
from wbc.sim.solve.solver import solve_program
from wbc.sim.state import SimState
from wbc.sim.step.impact import Impact, impact_elements, impact_mesh_loss
from wbc.sim.step.program import StepProgram, Unilateral

_SLOW = 1e-9
_ROUNDING = 1e-9
_FINEST = 1e-3


def settle(setup: Setup, state: SimState) -> tuple[SimState, Impact | None]:
    """Return the state after barriers that have just been reached are hit, and the impact if any.

    A barrier counts as reached where its gap is closed and the state does not know it to be.
    """
    barriers, space = setup.barriers, setup.space
    unknown = len(state.closed) != barriers.size
    closed = np.zeros(barriers.size, dtype=bool) if unknown else state.closed
    pin.crba(space.model, space.data, state.position, pin.Convention.WORLD)
    clearance = barriers.clearance(state.position)
    fresh = ~closed & (clearance.gap <= TOUCH)
    if not fresh.any():
        return (state.replace(closed=closed) if unknown else state), None
    contacts = barriers.contact_rows(clearance)
    approach = barriers.approach(contacts, state.velocity)
    together = closed | fresh
    if not np.any(fresh & (approach < -_SLOW)):
        return state.replace(closed=together), None
    impact = _collide(setup, state, together, contacts, approach)
    after = barriers.approach(contacts, impact.after)
    state = state.replace(velocity=impact.after, closed=together & (after <= TOUCH))
    return state, impact


def _collide(
    setup: Setup,
    state: SimState,
    closed: BoolArray,
    contacts: ContactRows,
    approach: FloatArray,
) -> Impact:
    """Return the impact of the `closed` barriers, for the kinematics held in the workspace.

    Newton's restitution with friction may ask for more energy than there was (Kane's paradox), or
    for what the joints cannot do. Without restitution an impact only loses energy; the largest
    restitution between that does so is taken.
    """
    if setup.restitution == 0.0:
        return _bounce(setup, state, closed, contacts, approach, 0.0)
    scale = kinetic_energy(setup, state.position, state.velocity)
    slack = -_ROUNDING * scale
    try:
        impact = _bounce(setup, state, closed, contacts, approach, setup.restitution)
        if impact.contact_loss >= slack:
            return impact
    except SimulationError:
        pass
    low, high = 0.0, setup.restitution
    best = _bounce(setup, state, closed, contacts, approach, low)
    while high - low > _FINEST:
        middle = 0.5 * (low + high)
        try:
            impact = _bounce(setup, state, closed, contacts, approach, middle)
            passive = impact.contact_loss >= slack
        except SimulationError:
            passive = False
        if passive:
            low, best = middle, impact
        else:
            high = middle
    return best


def _bounce(
    setup: Setup,
    state: SimState,
    closed: BoolArray,
    contacts: ContactRows,
    approach: FloatArray,
    restitution: float,
) -> Impact:
    """Return the impact after which normal speeds are -`restitution` times those before."""
    drive = setup.drive
    target = -restitution * np.minimum(approach, 0.0)
    hit = setup.barriers.closed_rows(closed, contacts, target)
    coupling = step_coupling(setup.robot, setup.space, state.position, state.velocity)
    solution = _solve(setup, state, hit.unilateral, coupling)
    after = np.array(solution.velocity)
    coupled = drive.zero if coupling is None else -coupling.inertia @ (after - state.velocity)
    motor = MotorMotion.of(drive, state).speed
    following = np.where(drive.loose, motor, drive.rows @ after)
    rigid = ~drive.loose
    net = coupled[rigid] - solution.element_impulse
    mesh = impact_mesh_loss(drive, motor[rigid], following[rigid], net)
    given = kinetic_energy(setup, state.position, state.velocity, motor)
    given -= kinetic_energy(setup, state.position, after, following)
    impulse = world_impulse(contacts, hit.which, solution)
    return Impact(
        state.time, state.velocity, after, impulse, mesh, given - mesh, restitution, solution
    )


def _solve(
    setup: Setup, state: SimState, unilateral: Unilateral, coupling: StepCoupling | None
) -> StepSolution:
    """Solve the impact's program, with rotor coupling by repetition."""
    drive, velocity = setup.drive, state.velocity
    inertia = setup.space.data.M.copy()
    motor = MotorMotion.of(drive, state).speed
    if coupling is None:
        elements = impact_elements(drive, motor, np.zeros(drive.size))
        return solve_program(StepProgram(inertia, velocity, elements, unilateral))
    last = velocity
    for _ in range(COUPLING_ROUNDS):
        change = last - velocity
        elements = impact_elements(drive, motor, -coupling.inertia @ change)
        back = np.linalg.solve(inertia, coupling.inertia.T @ (drive.rows @ change))
        solution = solve_program(StepProgram(inertia, velocity - back, elements, unilateral))
        moved = np.abs(solution.velocity - last).max(initial=0.0)
        if moved <= COUPLING_TOLERANCE * (1.0 + np.abs(last).max(initial=0.0)):
            return solution
        last = solution.velocity
    raise SimulationError(COUPLING_FAILED)
