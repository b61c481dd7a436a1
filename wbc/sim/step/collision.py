"""Taking an impact: barriers that are reached stop the robot at once."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import SimulationError
from wbc.sim.energy.flow_energy import ground_work
from wbc.sim.energy.kinetic_energy import kinetic_energy
from wbc.sim.ground.barriers import TOUCH, ClosedRows
from wbc.sim.ground.contact_rows import world_impulse
from wbc.sim.inner.impact import APART, RESTING
from wbc.sim.inner.inner import Struck
from wbc.sim.laws.coupling import (
    COUPLING_FAILED,
    COUPLING_ROUNDS,
    COUPLING_TOLERANCE,
    StepCoupling,
    step_coupling,
)
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.setup import Setup
from wbc.sim.solve.reduced import reduce_program
from wbc.sim.solve.solution import StepSolution
from wbc.sim.solve.solver import solve_program
from wbc.sim.state import SimState
from wbc.sim.step.impact import Impact, impact_elements, impact_mesh_loss
from wbc.sim.step.program import StepProgram, Unilateral

_SLOW = 1e-9
_ROUNDING = 1e-9
_FINEST = 1e-3


def settle(
    setup: Setup,
    state: SimState,
    left: float,
    springy: BoolArray | None = None,
    kept: BoolArray | None = None,
) -> tuple[SimState, Impact | None, BoolArray]:
    """Take the impact on barriers that have just been reached.

    A barrier counts as reached where its gap is closed and the state does not know it to be. After
    the impact those stay closed that part so slowly that gravity would bring them back within what
    is left of the step: their rows let them open, and spare them an impact and a part of their own.

    A kept barrier is a row of the rest of the step, and the row acts from the middle on. An impact
    elsewhere must not drive the robot through it before: where it closes faster than 2 gap/left it
    takes part in the impact, and then closes at that speed.

    Args:
        setup: the plant's.
        state: where the robot is.
        left: of the step [s].
        springy: (2 j + c,) barriers that give back the plant's restitution, None for all.
        kept: (2 j + c,) barriers that are rows of what is left of the step, None for none.

    Returns:
        the state after it, the impact if there was any, and which barriers (2 j + c,) were reached.

    Raises:
        SimulationError: a state whose closed barriers are not known starts inside the ground or
            beyond a joint limit.
    """
    barriers, space, inner = setup.barriers, setup.space, setup.inner
    unknown = len(state.closed) != barriers.size
    slow = 0.5 * setup.gravity * left
    if inner is not None and setup.restitution == 0.0 and not unknown and kept is None:
        struck = inner.impact(state, slow)
        if struck is not None:
            return _as_struck(setup, state, struck)
    closed = np.zeros(barriers.size, dtype=bool) if unknown else state.closed
    pin.crba(space.model, space.data, state.position, pin.Convention.WORLD)
    clearance = barriers.clearance(state.position, state.time)
    if unknown:
        check_outside(setup, clearance.gap)
    fresh = ~closed & (clearance.gap <= TOUCH)
    ahead = np.zeros_like(fresh) if kept is None else kept & ~(closed | fresh)
    if not (fresh | ahead).any():
        return (state.replace(closed=closed) if unknown else state), None, fresh
    together = closed | fresh | ahead
    hit = barriers.rows(together, clearance, np.zeros(barriers.size), state.time, state.time)
    approach = hit.approach(state.velocity)
    least = np.where(ahead[together], -2.0 * clearance.gap[together] / left, 0.0)
    if not np.any((fresh | ahead)[together] & (approach < least - _SLOW)):
        return state.replace(closed=closed | fresh), None, fresh
    back = np.full(len(approach), setup.restitution)
    if springy is not None:
        back[~springy[together]] = 0.0
    back[ahead[together]] = 0.0
    impact = _collide(setup, state, hit, least, -back * np.minimum(approach, 0.0))
    closed = together.copy()
    closed[together] = hit.approach(impact.after) <= max(TOUCH, slow)
    closed &= ~ahead
    return state.replace(velocity=impact.after, closed=closed), impact, fresh


def _as_struck(
    setup: Setup, state: SimState, struck: Struck
) -> tuple[SimState, Impact | None, BoolArray]:
    """Return what `settle` does, as compiled loops found it."""
    if struck.kind == APART:
        return state, None, struck.fresh
    if struck.kind == RESTING:
        return state.replace(closed=struck.closed), None, struck.fresh
    impact = Impact(
        state.time, state.velocity, struck.after, struck.contact_impulse, struck.mesh_loss,
        struck.contact_loss, 0.0, partial(_rebuilt, setup, state, struck),
    )  # fmt: skip
    after = SimState(
        state.position, struck.after, state.time, struck.closed, state.impulse, state.deflection,
        state.motor_velocity, state.memory,
    )  # fmt: skip
    return after, impact, struck.fresh


def _rebuilt(setup: Setup, state: SimState, struck: Struck) -> StepSolution:
    """Return the solution of an impact that compiled loops found.

    Its program is put together anew, without them: what the solution misses of its laws is then a
    check of the loops.
    """
    drive, barriers, space = setup.drive, setup.barriers, setup.space
    pin.crba(space.model, space.data, state.position, pin.Convention.WORLD)
    clearance, none = barriers.clearance(state.position, state.time), np.zeros(barriers.size)
    hit = barriers.rows(state.closed | struck.fresh, clearance, none, state.time, state.time)
    elements = impact_elements(drive, drive.rows @ state.velocity, drive.zero)
    inertia = space.data.M.copy()
    program = StepProgram(inertia, state.velocity, elements, hit.unilateral)
    reduced = reduce_program(program)
    speed = reduced.speeds(struck.impulse)
    used = struck.iterations
    return StepSolution(struck.after, struck.impulse, speed, used, "newton", reduced)


def check_outside(setup: Setup, gap: FloatArray) -> None:
    """Refuse a start inside the ground or beyond a joint limit.

    Args:
        setup: the plant's.
        gap: (2 j + c,).

    Raises:
        SimulationError: an overlap beyond TOUCH; it names the place and the depth.
    """
    depth = -float(gap.min(initial=0.0))
    if depth <= TOUCH:
        return
    place = int(np.argmin(gap))
    where = setup.barriers.names[place]
    beyond = f"{depth:.3g} rad (m) beyond its stop"
    inside = f"{1e3 * depth:.3g} mm inside the ground"
    raise SimulationError(
        f"the start of '{setup.robot.name}' overlaps: {where} is "
        f"{beyond if place < setup.barriers.limits else inside}. Place the robot outside, or "
        "let the plant do it: plant.state(position, lifted=True)."
    )


def _collide(
    setup: Setup, state: SimState, hit: ClosedRows, least: FloatArray, opening: FloatArray
) -> Impact:
    """Return the impact of the barriers `hit`, for the kinematics held in the workspace.

    Newton's restitution with friction may ask for more energy than there was (Kane's paradox), or
    for what the joints cannot do. Without restitution an impact only loses energy; the largest
    restitution between that does so is taken.

    Args:
        setup: the plant's.
        state: before.
        hit: the closed barriers.
        least: (l + c,) speeds to which these are stopped, zero or less.
        opening: (l + c,) speeds at which these should part, by the plant's restitution.
    """
    if not opening.any():
        return _bounce(setup, state, hit, least, opening, 0.0)
    scale = kinetic_energy(setup, state.position, state.velocity)
    slack = -_ROUNDING * scale
    try:
        impact = _bounce(setup, state, hit, least, opening, 1.0)
        if impact.contact_loss >= slack:
            return impact
    except SimulationError:
        pass
    low, high = 0.0, 1.0
    best = _bounce(setup, state, hit, least, opening, low)
    while (high - low) * setup.restitution > _FINEST:
        middle = 0.5 * (low + high)
        try:
            impact = _bounce(setup, state, hit, least, opening, middle)
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
    hit: ClosedRows,
    least: FloatArray,
    opening: FloatArray,
    share: float,
) -> Impact:
    """Return the impact after which barriers part at `least` plus `share` times `opening`."""
    drive = setup.drive
    unilateral = replace(hit.unilateral, target=least + share * opening)
    coupling = step_coupling(setup.robot, setup.space, state.position, state.velocity)
    solution = _solve(setup, state, unilateral, coupling)
    after = np.array(solution.velocity)
    coupled = drive.zero if coupling is None else -coupling.inertia @ (after - state.velocity)
    motor = MotorMotion.of(drive, state).speed
    following = np.where(drive.loose, motor, drive.rows @ after)
    rigid = ~drive.loose
    net = coupled[rigid] - solution.element_impulse
    mesh = impact_mesh_loss(drive, motor[rigid], following[rigid], net)
    given = kinetic_energy(setup, state.position, state.velocity, motor)
    given -= kinetic_energy(setup, state.position, after, following)
    work = ground_work(solution, unilateral.ground)
    impulse = world_impulse(hit.contacts, setup.barriers.points, solution)
    restitution = share * setup.restitution if opening.any() else 0.0
    return Impact(
        state.time, state.velocity, after, impulse, mesh, given + work - mesh, restitution,
        lambda: solution, work,
    )  # fmt: skip


def _solve(
    setup: Setup, state: SimState, unilateral: Unilateral, coupling: StepCoupling | None
) -> StepSolution:
    """Solve the impact's program, with rotor coupling by repetition."""
    drive, velocity = setup.drive, state.velocity
    inertia = setup.space.data.M.copy()
    motor = MotorMotion.of(drive, state).speed
    joints = setup.robot.transmission.joints
    names = [joints[i] for i in np.flatnonzero(~drive.loose).tolist()]
    if coupling is None:
        elements = impact_elements(drive, motor, np.zeros(drive.size))
        return solve_program(StepProgram(inertia, velocity, elements, unilateral), None, names)
    last = velocity
    for _ in range(COUPLING_ROUNDS):
        change = last - velocity
        elements = impact_elements(drive, motor, -coupling.inertia @ change)
        back = np.linalg.solve(inertia, coupling.inertia.T @ (drive.rows @ change))
        program = StepProgram(inertia, velocity - back, elements, unilateral)
        solution = solve_program(program, None, names)
        moved = np.abs(solution.velocity - last).max(initial=0.0)
        if moved <= COUPLING_TOLERANCE * (1.0 + np.abs(last).max(initial=0.0)):
            return solution
        last = solution.velocity
    raise SimulationError(COUPLING_FAILED)
