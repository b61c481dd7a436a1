"""Solving one step: Newton, then in proximal rounds, then after sweeps, then as a QP."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.branches import branches_at
from wbc.sim.newton import newton
from wbc.sim.program import StepProgram
from wbc.sim.proximal import proximal
from wbc.sim.qp import solve_qp
from wbc.sim.reduced import Reduced, reduce_program
from wbc.sim.solution import StepSolution
from wbc.sim.sweeps import sweep
from wbc.sim.uniqueness import check_uniqueness

TOLERANCE = 1e-10
"""Accepted distance of a row from its law, as a share of the largest speed or target plus 1."""


def solve_program(program: StepProgram, guess: FloatArray | None = None) -> StepSolution:
    """Return the velocity and row impulses that satisfy every law of a step at once.

    Args:
        program: the step.
        guess: row impulses (r,) to start from, those of the previous step; their branches are
            usually the right ones already.

    Raises:
        SimulationError: no solution was found, or a self-locking gear leaves several.
    """
    reduced = reduce_program(program)
    start = np.zeros(len(reduced.free)) if guess is None else guess
    tolerance = TOLERANCE * (
        1.0 + max(map(abs, reduced.free.tolist() + reduced.targets), default=0)
    )
    if len(reduced.free) > len(program.free_velocity):
        impulse, used, done = proximal(reduced, start, tolerance)
        method = "proximal"
    else:
        impulse, used, done = newton(reduced, start, tolerance, 12)
        method = "newton"
    if not done:
        impulse, used, method = _fall_back(reduced, start, tolerance, used)
    if any(law[4] < 0.0 for law in reduced.laws):
        check_uniqueness(reduced, impulse)
    return StepSolution(
        reduced.velocity(impulse), impulse, reduced.speeds(impulse), used, method, reduced
    )


def _fall_back(
    reduced: Reduced, start: FloatArray, tolerance: float, used: int
) -> tuple[FloatArray, int, str]:
    for origin in (start, np.zeros_like(start)):
        impulse, count, done = proximal(reduced, origin, tolerance)
        used += count
        if done:
            return impulse, used, "proximal"
    impulse = np.zeros_like(start)
    for sweeps in (5, 10, 20, 40, 80, 160):
        impulse = sweep(reduced, impulse, sweeps)
        better, count, done = newton(reduced, impulse, tolerance, 15)
        used += count
        if done:
            return better, used, "sweeps"
    certified = solve_qp(reduced, impulse)
    if certified is not None:
        better, count, done = newton(reduced, certified, tolerance, 10)
        used += count
        if done:
            return better, used, "qp"
        if _distance(reduced, certified) <= 1e3 * tolerance:
            return certified, used, "qp"
    raise SimulationError(
        f"a step with {reduced.elements} gears and joints and {reduced.contacts} contacts has no "
        f"solution within {tolerance:.1e} (nearest: {_distance(reduced, impulse):.1e}). Usual "
        "causes: a contact target that the joints cannot reach (a limit and the ground in "
        "conflict), or a self-locking gear whose falling branch leaves no solution; shorten the "
        "step or change the state."
    )


def _distance(reduced: Reduced, impulse: FloatArray) -> float:
    return branches_at(reduced, impulse, reduced.speeds(impulse)).worst
