"""Semi-smooth Newton iteration on the branches of the rows: the fast path."""

from __future__ import annotations

from wbc.arrays import FloatArray
from wbc.sim.solve.branches import branches_at, solve_branches
from wbc.sim.solve.reduced import Reduced

_FULL_STEPS = 4
_SHORTEST = 1e-2


def newton(
    reduced: Reduced, start: FloatArray, tolerance: float, limit: int
) -> tuple[FloatArray, int, bool]:
    """Iterate from row impulses `start` (r,) until every row is on its law.

    Full steps first: with the right branches, which warm starting usually has, one step is exact.
    Where they do not settle, steps are shortened until the residual falls.

    Returns:
        the row impulses, the number of linear systems solved, and whether it converged.
    """
    if len(start) == 0:
        return start, 0, True
    impulse = start
    branches = branches_at(reduced, impulse, reduced.speeds(impulse))
    for iteration in range(1, _FULL_STEPS + 1):
        following = solve_branches(reduced, branches, impulse)
        if following is None:
            return start, iteration, False
        impulse = following
        branches = branches_at(reduced, impulse, reduced.speeds(impulse))
        if branches.worst <= tolerance:
            return impulse, iteration, True
    return _damped(reduced, start, tolerance, limit)


def _damped(
    reduced: Reduced, start: FloatArray, tolerance: float, limit: int
) -> tuple[FloatArray, int, bool]:
    impulse = start
    branches = branches_at(reduced, impulse, reduced.speeds(impulse))
    merit = branches.merit
    for iteration in range(1, limit + 1):
        aim = solve_branches(reduced, branches, impulse)
        if aim is None:
            return impulse, iteration + _FULL_STEPS, False
        share = 1.0
        while True:
            trial = impulse + share * (aim - impulse)
            branches = branches_at(reduced, trial, reduced.speeds(trial))
            lower = branches.merit
            if lower < merit * (1.0 - 1e-3 * share) or share < _SHORTEST:
                break
            share *= 0.5
        impulse, merit = trial, lower
        if branches.worst <= tolerance:
            return impulse, iteration + _FULL_STEPS, True
    return impulse, limit + _FULL_STEPS, False
