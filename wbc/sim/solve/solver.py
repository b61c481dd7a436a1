"""Solving one step: Newton, in proximal rounds, after quadratic programs, after sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.solve.newton import newton
from wbc.sim.solve.proximal import proximal
from wbc.sim.solve.qp import qp_candidates
from wbc.sim.solve.reduced import Reduced, blown_up, reduce_program
from wbc.sim.solve.self_locking import solve_in_ranges, undecided_rows
from wbc.sim.solve.solution import StepSolution
from wbc.sim.solve.sweeps import sweep
from wbc.sim.step.program import StepProgram

TOLERANCE = 1e-10
"""Accepted distance of a row from its law, as a share of the largest speed or target plus 1.

A target below zero does not count: a row reaches it only at speeds that count already, and a
barrier that is kept in a short part has one that no speed comes near.
"""

_PROXIMAL_TRIES = 8
"""Quadratic programs whose solutions are worth proximal rounds, which cost as much as they do."""


def solve_program(
    program: StepProgram, guess: FloatArray | None = None, names: Sequence[str] = ()
) -> StepSolution:
    """Return the velocity and row impulses that satisfy every law of a step at once.

    Args:
        program: the step.
        guess: row impulses (r,) to start from, those of the previous step; their branches are
            usually the right ones already.
        names: of the dissipative rows, for messages.

    Raises:
        SimulationError: no solution was found, or a self-locking gear leaves several.
    """
    reduced = reduce_program(program)
    start = np.zeros(len(reduced.free)) if guess is None else guess
    fastest = max(np.abs(reduced.free).max(initial=0.0), reduced.targets.max(initial=0.0))
    tolerance = TOLERANCE * (1.0 + float(fastest))
    if program.elements.backward.min(initial=0.0) < 0.0:
        rows = undecided_rows(reduced)
        if rows.size:
            impulse, used = solve_in_ranges(reduced, rows, start, tolerance, names)
            return _solution(reduced, impulse, used, "ranges")
    # With more rows than freedoms shortened steps crawl along directions that move nothing.
    shortened = 0 if len(reduced.free) > len(program.free_velocity) else 12
    impulse, used, done = newton(reduced, start, tolerance, shortened)
    if not done and start.any():  # The last step's branches lead astray: start from none.
        impulse, more, done = newton(reduced, np.zeros_like(start), tolerance, shortened)
        used += more
    method = "newton"
    if not done:
        impulse, used, method = _fall_back(reduced, start, tolerance, used)
    return _solution(reduced, impulse, used, method)


def _solution(reduced: Reduced, impulse: FloatArray, used: int, method: str) -> StepSolution:
    return StepSolution(
        reduced.velocity(impulse), impulse, reduced.speeds(impulse), used, method, reduced
    )


def _fall_back(
    reduced: Reduced, start: FloatArray, tolerance: float, used: int
) -> tuple[FloatArray, int, str]:
    if not np.isfinite(reduced.delassus).all() or not np.isfinite(reduced.free).all():
        raise blown_up(reduced.program.inertia, reduced.program.free_velocity)
    for origin in (start, np.zeros_like(start)):
        impulse, count, done = proximal(reduced, origin, tolerance)
        used += count
        if done:
            return impulse, used, "proximal"
    nearest = start
    for i, (candidate, solved) in enumerate(qp_candidates(reduced)):
        # Two flat feet leave Newton's systems singular even beside the solution.
        worth = solved and i < _PROXIMAL_TRIES
        for finish in (partial(newton, limit=10), proximal)[: 2 if worth else 1]:
            impulse, count, done = finish(reduced, candidate, tolerance=tolerance)
            used += count
            if done:
                return impulse, used, "qp"
        if reduced.distance(candidate) < reduced.distance(nearest):
            nearest = candidate
    if reduced.distance(nearest) <= 1e3 * tolerance:
        return nearest, used, "qp"
    impulse = np.zeros_like(start)
    for sweeps in (5, 10, 20, 40, 80, 160):
        impulse = sweep(reduced, impulse, sweeps)
        better, count, done = newton(reduced, impulse, tolerance, 15)
        used += count
        if done:
            return better, used, "sweeps"
    raise SimulationError(
        f"a step with {reduced.elements} gears and joints and {reduced.contacts} contacts has no "
        f"solution within {tolerance:.1e} (nearest: {reduced.distance(impulse):.1e}). Usual "
        "causes: a contact target that the joints cannot reach (a limit and the ground in "
        "conflict), or a self-locking gear whose falling branch leaves no solution; shorten the "
        "step or change the state."
    )
