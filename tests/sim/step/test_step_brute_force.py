"""The step solver against all solutions of random steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.step.brute_force import Case, solutions
from tests.sim.step.random_steps import laws_of, random_step
from wbc.errors import SimulationError
from wbc.sim import StepProgram, solve_program

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
        assert found.residuals.max() < 1e-9 * scale
        pushes = program.rows.T @ found.impulse
        moved = program.inertia @ (found.velocity - program.free_velocity)
        assert np.abs(moved - pushes).max() < 1e-9 * scale


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
        assert found.residuals.max() < 1e-9 * scale
        assert len(impulses) > 0


def _light_and_locking(
    rng: np.random.Generator, gears: int, contacts: int = 0
) -> tuple[StepProgram, Case]:
    """Return a step whose rotors may be too light for what their gears lock."""
    program, case = random_step(rng, gears, contacts)
    reflected = 10.0 ** rng.uniform(-2.0, 1.0, gears)
    eta_b = np.where(rng.random(gears) < 0.7, -rng.uniform(0.02, 2.0, gears), case.eta_b)
    brought = rng.normal(size=gears)
    case = replace(case, inertia=reflected, eta_b=eta_b, brought=brought)
    return replace(program, laws=laws_of(case)), case


@pytest.mark.parametrize("gears", [1, 2, 3])
def test_locking_gears_are_solved_where_one_solution_exists_and_refused_where_several(
    gears: int,
) -> None:
    rng = np.random.default_rng(40 + gears)
    seen = {"one": 0, "one, found by trying": 0, "several": 0, "none": 0}
    for _ in range(400):
        program, case = _light_and_locking(rng, gears)
        _, speeds = solutions(case)
        scale = 1.0 + np.abs(case.free).max()
        apart = np.abs(speeds - speeds[0]).max() if len(speeds) else 0.0
        falling = np.where(case.eta_b < 0.0, case.eta_b / case.inertia, 0.0)
        unique = np.linalg.eigvalsh(case.Lambda + np.diag(falling))[0] > 0.0
        if unique:
            assert len(speeds) > 0
            assert apart < 1e-6 * scale
        if len(speeds) == 0 or apart > 1e-3 * scale:
            seen["several" if len(speeds) else "none"] += 1
            with pytest.raises(SimulationError, match=r"\d solutions|no solution"):
                solve_program(program)
        elif apart < 1e-6 * scale:
            seen["one" if unique else "one, found by trying"] += 1
            assert np.abs(solve_program(program).speed - speeds[0]).max() < 1e-6 * scale
    assert seen["one"] > 20
    assert seen["one, found by trying"] > 20
    assert seen["several"] > 10


@pytest.mark.parametrize(("gears", "contacts"), [(1, 1), (2, 1), (1, 2)])
def test_locking_gears_on_contacts_run_wherever_one_solution_exists(
    gears: int, contacts: int
) -> None:
    rng, solved, refused = np.random.default_rng(gears + 10 * contacts), 0, 0
    for _ in range(150):
        program, case = _light_and_locking(rng, gears, contacts)
        _, speeds = solutions(case)
        scale = 1.0 + np.abs(case.free).max()
        assert len(speeds) > 0
        one = np.abs(speeds - speeds[0]).max() < 1e-6 * scale
        try:
            found, message = solve_program(program).speed, ""
        except SimulationError as error:
            found, message = np.full(speeds.shape[1], np.nan), str(error)
        if message:
            refused += 1
            assert not one
            assert "solutions with the self-locking gears" in message
        else:
            solved += 1
            assert np.abs(speeds - found).max(axis=1).min() < 1e-6 * scale
    assert solved > 50
    assert refused > 2


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
