"""The rows' system solved in velocities says what it says in impulses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from tests.sim.step.test_cones import CORPORA, random_step
from wbc.mechanics.in_velocities import solve_in_velocities
from wbc.mechanics.newton import look_at, newton
from wbc.mechanics.rows import solve_pieces
from wbc.sim.step.program import tolerance_of


def _both(program):
    """Return the step's system of rows, to be solved in impulses and in velocities."""
    system, _ = program.system()
    ways = np.ascontiguousarray(system.half.T)
    return system._replace(ways=np.empty((0, 0))), system._replace(ways=ways)


@pytest.mark.parametrize("corpus", CORPORA)
def test_one_system_of_pieces(corpus: str) -> None:
    """At any point where the rows are fewer than the freedoms, all impulses are determined."""
    compared = 0
    for seed in range(400):
        program = random_step(corpus, seed)
        (system, other), rng = _both(program), np.random.default_rng(seed)
        size = len(system.free)
        if size > len(program.inertia):
            continue
        impulse = rng.normal(size=size)
        pieces, sliding = np.empty((size, 4)), np.empty((len(system.frictions), 3))
        look_at(system, impulse, np.empty(size), pieces, sliding)
        found = []
        for solve, given in ((solve_pieces, system), (solve_in_velocities, other)):
            solved = np.empty(size)
            assert solve(given, pieces, sliding, impulse, solved)
            found.append(solved)
        scale = np.abs(found[0]).max()
        # Rows that barely move anything are held by the spring: their split says nothing.
        if np.linalg.cond(system.delassus) < 1e4 and scale < 1e3:
            compared += 1
            assert np.abs(found[1] - found[0]).max() <= 1e-6 * scale
    assert compared > 10


@pytest.mark.parametrize("corpus", CORPORA)
def test_newton_finds_the_same_motion_as_often(corpus: str) -> None:
    """Where it settles early; after that, rounding may lead to another of several solutions.

    Which seeds only one of the two ways settles depends on rounding, hence on the processor. A sign
    test over these seeds asks whether the way in velocities settles them less often than the other.
    """
    alone, compared = [0, 0], 0
    for seed in range(400):
        program = random_step(corpus, seed)
        both = _both(program)
        start, found, longest, settled = np.zeros(len(both[0].free)), [], 0, []
        for system in both:
            impulse = np.empty(len(start))
            used = newton(system, start, tolerance_of(system), 0, impulse)
            longest = max(longest, abs(used))
            settled.append(used > 0)
            if used > 0:
                found.append(system.delassus @ impulse)
        if len(found) == 1:
            alone[settled.index(True)] += 1
        if len(found) == 2 and longest <= 6:
            compared += 1
            assert np.abs(found[1] - found[0]).max() < 1e-7 * (1.0 + np.abs(found[0]).max())
    assert compared > 50
    assert binomtest(alone[1], max(sum(alone), 1), alternative="less").pvalue > 0.001
