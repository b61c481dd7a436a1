"""The step solver against all solutions of random steps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.brute_force import solutions
from tests.sim.random_steps import random_step
from wbc.sim import solve_program

COUNTS = {1: 800, 2: 800, 3: 600, 4: 400, 5: 100, 6: 20}


@pytest.mark.parametrize("gears", COUNTS)
@pytest.mark.parametrize("locking", [False, True])
def test_gears_have_one_solution_and_it_is_found(gears: int, locking: bool) -> None:
    rng = np.random.default_rng(1000 * gears + locking)
    for _ in range(COUNTS[gears]):
        program, case = random_step(rng, gears, locking=locking)
        _, speeds = solutions(case)
        found = solve_program(program)
        scale = 1.0 + np.abs(case.free).max()
        assert len(speeds) > 0
        assert np.abs(speeds - speeds[0]).max() < 1e-6 * scale, "brute force: several solutions"
        assert np.abs(found.speed - speeds[0]).max() < 1e-7 * scale
        assert found.residuals.worst_speed < 1e-9 * scale
        assert found.residuals.dynamics < 1e-9 * scale


@pytest.mark.parametrize(("gears", "contacts"), [(0, 1), (1, 1), (2, 1), (0, 2), (2, 2), (3, 1)])
def test_contacts_with_friction_find_a_solution_of_coulombs_law(gears: int, contacts: int) -> None:
    rng = np.random.default_rng(17 * gears + contacts)
    for _ in range(150):
        program, case = random_step(rng, gears, contacts)
        impulses, speeds = solutions(case)
        found = solve_program(program)
        scale = 1.0 + np.abs(case.free).max()
        assert np.abs(speeds - found.speed).max(axis=1).min() < 1e-7 * scale
        assert np.abs(found.velocity - program.free_velocity).max() < 1e6
        assert found.residuals.worst_speed < 1e-9 * scale
        assert len(impulses) > 0


def test_the_guess_does_not_change_the_answer() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        program, case = random_step(rng, 4)
        cold = solve_program(program)
        warm = solve_program(program, rng.normal(size=4))
        assert np.abs(cold.velocity - warm.velocity).max() < 1e-8 * (1.0 + np.abs(case.free).max())
        again = solve_program(program, cold.impulse)
        assert again.iterations == 1
        assert np.abs(cold.velocity - again.velocity).max() < 1e-9 * (1 + np.abs(case.free).max())


def test_same_program_same_bits() -> None:
    rng = np.random.default_rng(6)
    program, _ = random_step(rng, 5, 2)
    assert np.array_equal(solve_program(program).velocity, solve_program(program).velocity)
