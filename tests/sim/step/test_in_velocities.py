"""The rows' system solved in velocities says what it says in impulses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from tests.sim.step.test_cones import CORPORA, random_step
from wbc.sim.solve.branches import pieces_at, solve_pieces
from wbc.sim.solve.in_velocities import solve_in_velocities
from wbc.sim.solve.newton import newton
from wbc.sim.solve.reduced import IN_IMPULSES, reduce_program
from wbc.sim.solve.solver import TOLERANCE


def _ways(program):
    """W' of a step of any size."""
    lower = np.linalg.cholesky(program.inertia)
    return np.ascontiguousarray(np.linalg.solve(lower, program.rows().T).T)


@pytest.mark.parametrize("corpus", CORPORA)
def test_one_system_of_pieces(corpus: str) -> None:
    """At any point where the rows are fewer than the freedoms, all impulses are determined."""
    compared = 0
    for seed in range(400):
        program = random_step(corpus, seed)
        reduced, rng = reduce_program(program), np.random.default_rng(seed)
        size = len(reduced.free)
        if size > len(program.inertia):
            continue
        impulse = rng.normal(size=size)
        pieces, sliding = np.empty((size, 4)), np.empty((reduced.contacts, 3))
        laws = reduced.laws, reduced.targets, reduced.frictions, reduced.tangents, reduced.slope
        pieces_at(*laws, impulse, reduced.speeds(impulse), pieces, sliding)
        given = reduced.spring, reduced.slope, reduced.frictions, reduced.tangents
        found = []
        for solve, matrix in (
            (solve_pieces, reduced.delassus),
            (solve_in_velocities, _ways(program)),
        ):
            solved = np.empty(size)
            assert solve(matrix, *given, pieces, sliding, impulse, solved)
            found.append(solved)
        scale = np.abs(found[0]).max()
        # Rows that barely move anything are held by the spring: their split says nothing.
        if np.linalg.cond(reduced.delassus) < 1e4 and scale < 1e3:
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
        reduced = reduce_program(program)
        start, found, longest, settled = np.zeros(len(reduced.free)), [], 0, []
        tolerance = TOLERANCE * (1.0 + float(np.abs(reduced.free).max(initial=0.0)))
        for ways in (IN_IMPULSES, _ways(program)):
            impulse, used, good = newton(replace(reduced, ways=ways), start, tolerance, 0)
            longest = max(longest, used)
            settled.append(good)
            if good:
                found.append(reduced.velocity(impulse))
        if len(found) == 1:
            alone[settled.index(True)] += 1
        if len(found) == 2 and longest <= 6:
            compared += 1
            assert np.abs(found[1] - found[0]).max() < 1e-7 * (1.0 + np.abs(found[0]).max())
    assert compared > 50
    assert binomtest(alone[1], max(sum(alone), 1), alternative="less").pvalue > 0.001
