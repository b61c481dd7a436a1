"""The program of one part: forces, barriers and gear rows put together, and its solution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import SimulationError
from wbc.sim.ground.barriers import ClosedRows
from wbc.sim.laws.coupling import (
    COUPLING_FAILED,
    COUPLING_ROUNDS,
    COUPLING_TOLERANCE,
    StepCoupling,
)
from wbc.sim.laws.gear_rows import GearRows, gear_rows
from wbc.sim.laws.grip import Grip
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.setup import Setup
from wbc.sim.solve.reduced import blown_up
from wbc.sim.solve.solution import StepSolution
from wbc.sim.solve.solver import solve_program
from wbc.sim.state import SimState
from wbc.sim.step.flight import Middle, joint_bias
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.program import StepProgram

Solved: TypeAlias = tuple[GearRows, IntArray, StepSolution]
"""The gears' rows, the places of all rows in `SimState.impulse`, and the solution."""
_NEWTON = 8  # rounds, of the 3 to 5 that crossings take
_ROUNDS = 200


@dataclass(frozen=True, eq=False, slots=True)
class PartProgram:
    """Everything that stays the same while the rows of one part are solved.

    Attributes:
        setup: the plant's, with inertias at the middle of the part.
        state: at the start.
        velocity: v (nv,) in the middle, before forces and rows act.
        motor: motion of the motor outputs at the start.
        step: h [s].
        forces: of the effects.
        force: (nv,) of effects, gravity, velocity terms and from outside.
        held: rows of the closed and kept barriers.
        coupling: inertial coupling of rotors and housings, None for none.
    """

    setup: Setup
    state: SimState
    velocity: FloatArray
    motor: MotorMotion
    step: float
    forces: EffectForces
    force: FloatArray
    held: ClosedRows
    coupling: StepCoupling | None


def _opening(gap: FloatArray, kept: BoolArray, step: float) -> FloatArray:
    """Return the lowest speed (2 j + c,) at which gaps (2 j + c,) may open over a step.

    A barrier that was kept ahead of its closing may close, over the half step that is left. One
    that is closed may not: the drift of its gap is a matter of place, not of speed.
    """
    if not kept.any():
        return np.zeros(len(gap))
    return np.asarray(-2.0 / step * np.maximum(gap, 0.0) * kept)


def _add_drift(held: ClosedRows, velocity: FloatArray, rate: FloatArray, kept: BoolArray) -> None:
    """Let closed contacts close over the second half by what they opened over the first.

    A point that rests at the start of a part moves in the middle, by the turning of its row; were
    it held at rest there, its force would do work at the mean of both speeds. Held at minus that
    speed it does none, and comes to rest where the part ends. It is never pushed out: with targets
    at or below zero contacts make no energy, whatever else happens in the part.

    Args:
        held: rows of the closed barriers, whose targets are changed.
        velocity: v (nv,) in the middle.
        rate: (l + c,) the robot's speed along the contacts at the start.
        kept: (l + c,) barriers that have a target of their own.
    """
    drift, first = held.turning(velocity) - rate, len(held.limits)
    free = ~kept
    free[:first] = False
    held.unilateral.target[free] = -np.maximum(drift[free], 0.0)


def problem_of(
    setup: Setup,
    state: SimState,
    middle: Middle,
    rate: FloatArray,
    forces: EffectForces,
    external: FloatArray | None,
    kept: BoolArray,
    step: float,
    coupling: StepCoupling | None,
) -> PartProgram:
    """Return the forces and barriers of a part, for the workspace that stands at its middle."""
    force = forces.joint - joint_bias(setup.bases, setup.space, middle)
    if external is not None:
        force += external
    now = state.time + 0.5 * step
    clearance = setup.barriers.clearance(middle.position, now)
    closed = state.closed | kept
    opening = _opening(clearance.gap, kept, step)
    # Speeds count from the ground's at the end, so that what holds on to it ends at its speed.
    held = setup.barriers.rows(closed, clearance, opening, now, state.time + step)
    _add_drift(held, middle.velocity, rate[closed], kept[closed])
    motor = MotorMotion.of(setup.drive, state)
    return PartProgram(setup, state, middle.velocity, motor, step, forces, force, held, coupling)


def solve_gripped(problem: PartProgram) -> Solved:
    """Solve the part; where gears have springs or play, by Newton's method on their flanks.

    One round is enough unless a flank is reached or let go within the part. Then Newton's method
    may repeat the same few guesses. The law of a flank is monotone, as all others are, so rounds
    that use the steepest slope on the way always come nearer. From the ninth round on such rounds
    alternate with Newton's, with the steepest slope met so far. Half of it is forgotten each time,
    or one steep place far off would make all that follow slow; where the rest is too little, the
    round goes too far and meets the slope between.

    Raises:
        SimulationError: the step has no solution, or the flanks' law is not met.
    """
    drive, motor, step = problem.setup.drive, problem.motor, problem.step
    if not drive.any_loose:
        return _solve_any(problem, Grip.firm(drive))
    released, steepest = np.zeros(drive.size, dtype=bool), drive.zero
    start = Grip.at(drive, motor, motor.relative, step)
    side = np.sign(motor.deflection + 0.5 * step * motor.relative)
    for turn in range(_ROUNDS):
        safely = turn >= _NEWTON and turn % 2 == 0
        grip = (start.steepened(steepest) if safely else start).without(released)
        solved = _solve_any(problem, grip)
        gears, _, solution = solved
        mesh, speed = gears.passed(solution)
        end = motor.after(drive, solution.velocity, speed, step).relative
        passed = Grip.at(drive, motor, end, step)
        pulling = drive.hard_play & (side * mesh < 0.0)
        if not (pulling.any() or grip.misses(passed).any()):
            return replace(gears, damped=passed.damped), *solved[1:]
        released |= pulling
        lasting = 0.5 if safely else 1.0
        steepest = np.maximum(lasting * steepest, grip.secant(passed))
        if safely:
            safe = passed
        start = safe if turn > _NEWTON and not safely else passed
    names = problem.setup.robot.transmission.joints
    worst = [names[i] for i in np.flatnonzero(grip.misses(passed)).tolist()]
    raise SimulationError(
        f"the gear flanks of {', '.join(worst)} do not meet their law after {_ROUNDS} rounds; "
        "shorten dt."
    )


def _solve_any(problem: PartProgram, grip: Grip) -> Solved:
    """Solve the step once, with or without rotor coupling."""
    if problem.coupling is None:
        return _solve(problem, grip, None, None)
    return _solve_coupled(problem, grip, problem.coupling)


def _solve_coupled(problem: PartProgram, grip: Grip, coupling: StepCoupling) -> Solved:
    """Repeat the step with the rotor coupling of its last iterate until the velocity repeats."""
    drive, velocity = problem.setup.drive, problem.velocity
    last = velocity
    for _ in range(COUPLING_ROUNDS):
        change = last - velocity
        links = coupling.inertia.T @ (drive.rows @ change) + problem.step * coupling.link_bias
        rotors = coupling.inertia @ change + problem.step * coupling.rotor_bias
        solved = _solve(problem, grip, links, rotors)
        reached = solved[2].velocity
        moved = np.abs(reached - last).max(initial=0.0)
        if moved <= COUPLING_TOLERANCE * (1.0 + np.abs(last).max(initial=0.0)):
            return solved
        last = reached
    raise SimulationError(COUPLING_FAILED)


def _solve(
    problem: PartProgram,
    grip: Grip,
    on_links: FloatArray | None,
    on_rotors: FloatArray | None,
) -> Solved:
    """Solve the step once, less the impulses (nv,) and (m,) that the rotor coupling takes."""
    setup = problem.setup
    gears, places, program = program_of(problem, grip, on_links, on_rotors)
    guess = setup.layout.recall(problem.state.impulse, places)
    names = setup.robot.transmission.joints
    if len(gears.engaged) < len(names):
        names = tuple(names[i] for i in gears.engaged.tolist())
    return gears, places, solve_program(program, guess, names)


def program_of(
    problem: PartProgram,
    grip: Grip,
    on_links: FloatArray | None,
    on_rotors: FloatArray | None,
) -> tuple[GearRows, IntArray, StepProgram]:
    """Return the gears' rows, the places of all rows in `SimState.impulse`, and the program."""
    setup, step, motor = problem.setup, problem.step, problem.motor
    inertia = setup.space.data.M.copy()
    push = step * problem.force
    driven = step * (setup.drive.ratio * problem.forces.rotor)
    if on_links is not None and on_rotors is not None:
        push = push - on_links
        driven = driven - on_rotors
    _, change, info = lapack.dposv(inertia, push)
    if info != 0:
        raise blown_up(setup.space.data.M, problem.state.velocity)
    gears = gear_rows(setup.drive, driven, problem.forces.friction, step, motor, grip)
    places = setup.layout.places(gears, problem.held)
    free = problem.velocity + change
    program = StepProgram(inertia, free, gears.elements, problem.held.unilateral)
    return gears, places, program
