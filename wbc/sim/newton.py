"""Semi-smooth Newton iteration on the branches of the rows: the fast path."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.branches import branches_at, solve_branches
from wbc.sim.reduced import Reduced
from wbc.sim.residual import row_residual

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
    impulse = start
    if len(start) == 0:
        return start, 0, True
    branches = branches_at(reduced, impulse, reduced.speeds(impulse))
    for iteration in range(1, _FULL_STEPS + 1):
        following = solve_branches(reduced, branches, impulse)
        if following is None:
            return start, iteration, False
        impulse = following
        speed = reduced.speeds(impulse)
        if np.abs(row_residual(reduced, impulse, speed)).max(initial=0.0) <= tolerance:
            return impulse, iteration, True
        branches = branches_at(reduced, impulse, speed)
    return _damped(reduced, start, tolerance, limit)


def _damped(
    reduced: Reduced, start: FloatArray, tolerance: float, limit: int
) -> tuple[FloatArray, int, bool]:
    impulse, speed = start, reduced.speeds(start)
    residual = row_residual(reduced, impulse, speed)
    merit = float(residual @ residual)
    for iteration in range(1, limit + 1):
        aim = solve_branches(reduced, branches_at(reduced, impulse, speed), impulse)
        if aim is None:
            return impulse, iteration, False
        share = 1.0
        while True:
            trial = impulse + share * (aim - impulse)
            trial_speed = reduced.speeds(trial)
            residual = row_residual(reduced, trial, trial_speed)
            lower = float(residual @ residual)
            if lower < merit * (1.0 - 1e-3 * share) or share < _SHORTEST:
                break
            share *= 0.5
        if np.abs(residual).max(initial=0.0) <= tolerance:
            return trial, iteration + _FULL_STEPS, True
        impulse, speed, merit = trial, trial_speed, lower
    return impulse, limit + _FULL_STEPS, False
