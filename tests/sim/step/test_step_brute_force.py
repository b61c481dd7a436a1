"""The step solver against every solution of small steps, found by trying all modes.

They share nothing with wbc.sim. They are written from the mesh law as it stands in the books: t is
what the rotor gives to the mesh, T = eta_f t where the motor drives, t = eta_b T where the joint
drives, and at rest any T for which some t within the rotor's stiction lies between eta_b T and
T / eta_f.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.sim.step.programs import Program, solve_program
from wbc.errors import SimulationError

COUNTS = {1: 300, 2: 400, 3: 300, 4: 200, 5: 40, 6: 8}


@dataclass(frozen=True)
class Case:
    """A random step: w = free + Lambda T, gears first, then planar contacts (normal, tangent)."""

    Lambda: np.ndarray
    free: np.ndarray
    brought: np.ndarray
    coulomb: np.ndarray
    inertia: np.ndarray
    eta_f: np.ndarray
    eta_b: np.ndarray
    mu: np.ndarray


STUCK, UP_FORWARD, UP_BACKWARD, DOWN_FORWARD, DOWN_BACKWARD = range(5)
OPEN, STICK, SLIDE_PLUS, SLIDE_MINUS = range(4)


def solutions(case: Case, tolerance: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """Return impulses (S, r) and speeds (S, r) of all solutions, duplicates included."""
    m, k = len(case.brought), len(case.mu)
    modes = np.array(list(itertools.product(*([range(5)] * m + [range(4)] * k))), dtype=int)
    modes = modes.reshape(-1, m + k)
    gears, contacts = modes[:, :m], modes[:, m:]
    sign = np.array([0, 1, 1, -1, -1])[gears]
    forward = np.array([False, True, False, True, False])[gears]
    gain = np.where(forward, 1.0 / case.eta_f, case.eta_b)
    size, own = m + 2 * k, np.arange(m)
    on_speed, on_impulse = np.zeros((2, len(modes), size, size))
    right = np.zeros((len(modes), size))
    on_speed[:, own, own] = np.where(sign == 0, 1.0, case.inertia)
    on_impulse[:, own, own] = np.where(sign == 0, 0.0, gain)
    right[:, :m] = np.where(sign == 0, 0.0, case.brought - sign * case.coulomb)
    for i in range(k):
        n, t, kind = m + i, m + k + i, contacts[:, i]
        on_speed[:, n, n] = kind != OPEN
        on_impulse[:, n, n] = kind == OPEN
        on_speed[:, t, t] = kind == STICK
        on_impulse[:, t, t] = kind != STICK
        slide = np.where(kind == SLIDE_PLUS, 1.0, np.where(kind == SLIDE_MINUS, -1.0, 0.0))
        on_impulse[:, t, n] = slide * case.mu[i]
    system = on_speed @ case.Lambda + on_impulse
    regular = np.abs(np.linalg.det(system)) > 1e-300
    impulse = np.full(right.shape, np.nan)
    rest = right - on_speed @ case.free
    impulse[regular] = np.linalg.solve(system[regular], rest[regular][:, :, None])[:, :, 0]
    speed = case.free + impulse @ case.Lambda.T
    scale = tolerance * (1.0 + np.abs(case.free).max())
    good = regular & np.isfinite(impulse).all(axis=1)
    for i in range(m):
        good &= _gear_holds(case, i, sign[:, i], forward[:, i], impulse, speed, scale)
    for i in range(k):
        good &= _contact_holds(case, i, contacts[:, i], impulse, speed, scale)
    return impulse[good], speed[good]


def _gear_holds(case, i, sign, forward, impulse, speed, scale):
    T, w = impulse[:, i], speed[:, i]
    force = scale / case.Lambda[i, i]
    driving = np.where(forward, sign * T >= -force, sign * T <= force)
    moving = (sign * w >= -scale) & driving
    one, other = T / case.eta_f[i], T * case.eta_b[i]
    low, high = np.minimum(one, other), np.maximum(one, other)
    slack = force / min(case.eta_f[i], 1.0)
    most, least = case.brought[i] + case.coulomb[i], case.brought[i] - case.coulomb[i]
    resting = (low <= most + slack) & (high >= least - slack)
    return np.where(sign == 0, resting, moving)


def _contact_holds(case, i, kind, impulse, speed, scale):
    m, k = len(case.brought), len(case.mu)
    n, t = m + i, m + k + i
    force = scale / case.Lambda[n, n]
    pn, pt, un, ut = impulse[:, n], impulse[:, t], speed[:, n], speed[:, t]
    held = np.select(
        [kind == STICK, kind == SLIDE_PLUS],
        [np.abs(pt) <= case.mu[i] * pn + force, ut >= -scale],
        ut <= scale,
    )
    return np.where(kind == OPEN, un >= -scale, (pn >= -force) & held)


def random_step(
    rng: np.random.Generator, gears: int, contacts: int = 0, locking: bool = False
) -> tuple[Program, Case]:
    """Return a random robot at a random moment.

    Gear ratios up to 160 spread N^2 I_r over five decades; half of the gears start at rest, some
    bring exactly their limit of stiction, some reverse.
    """
    n = gears + int(rng.integers(1, 4)) if gears + contacts else 1
    root = rng.normal(size=(n, n))
    inertia = root @ root.T + 0.05 * np.eye(n)
    rows = rng.normal(size=(gears + 2 * contacts, n))
    reflected = rng.uniform(1.0, 160.0, gears) ** 2 * 10.0 ** rng.uniform(-6.0, -4.0, gears)
    eta_f = rng.uniform(0.5, 1.0, gears)
    eta_b = np.minimum(rng.uniform(0.02, 1.6, gears), 1.0 / eta_f)
    wedge = rng.random(gears) < 0.5
    eta_b = np.where(wedge, np.maximum(2.0 - 1.0 / eta_f, 0.0), eta_b)
    free_velocity = rng.normal(size=n) * 10.0 ** rng.uniform(-2.0, 1.0)
    moving = rng.random(gears) < 0.5
    before = rows[:gears] @ free_velocity * rng.uniform(-1.0, 1.0, gears) * moving
    brought = reflected * before + 1e-2 * rng.normal(size=gears) * (rng.random(gears) < 0.7)
    coulomb = 1e-2 * rng.random(gears) * (rng.random(gears) < 0.4)
    Lambda = rows @ np.linalg.solve(inertia, rows.T)
    if locking and gears:
        margin = np.linalg.eigvalsh(Lambda[:gears, :gears])[0]
        fall = rng.random(gears) < 0.5
        eta_b = np.where(fall, -0.5 * margin * reflected * rng.random(gears), eta_b)
        eta_b = np.maximum(eta_b, -3.0)
    mu = rng.uniform(0.0, 1.2, contacts)
    case = Case(Lambda, rows @ free_velocity, brought, coulomb, reflected, eta_f, eta_b, mu)
    targets = np.zeros(contacts)
    return Program(inertia, free_velocity, rows, laws_of(case), targets, mu, 1), case


def laws_of(case: Case) -> np.ndarray:
    """Return the laws (m, 9) of the gears of a case, see `wbc.mechanics.rows.RowSystem`."""
    zero, brought, dry = np.zeros(len(case.brought)), case.brought, case.coulomb
    laws = brought - dry, brought + dry, case.inertia, 1.0 / case.eta_f, case.eta_b
    return np.column_stack((*laws, zero, zero, zero + np.inf, zero))


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
) -> tuple[Program, Case]:
    """Return a step whose rotors may be too light for what their gears lock."""
    program, case = random_step(rng, gears, contacts)
    reflected = 10.0 ** rng.uniform(-2.0, 1.0, gears)
    eta_b = np.where(rng.random(gears) < 0.7, -rng.uniform(0.02, 2.0, gears), case.eta_b)
    brought = rng.normal(size=gears)
    case = replace(case, inertia=reflected, eta_b=eta_b, brought=brought)
    return replace(program, laws=laws_of(case)), case


@pytest.mark.parametrize(("gears", "contacts"), [(1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (1, 2)])
def test_locking_gears_run_wherever_one_solution_exists_and_are_refused_where_several(
    gears: int, contacts: int
) -> None:
    rng = np.random.default_rng(40 + gears + 10 * contacts)
    seen = {"one": 0, "found by trying": 0, "refused": 0}
    for _ in range(150 if contacts else 250):
        program, case = _light_and_locking(rng, gears, contacts)
        _, speeds = solutions(case)
        scale = 1.0 + np.abs(case.free).max()
        apart = np.abs(speeds - speeds[0]).max() / scale if len(speeds) else np.inf
        falling = np.where(case.eta_b < 0.0, case.eta_b / case.inertia, 0.0)
        own = case.Lambda[:gears, :gears] + np.diag(falling)
        unique = not contacts and np.linalg.eigvalsh(own)[0] > 0.0
        if unique or contacts:
            assert len(speeds) > 0
            assert apart < 1e-6 or contacts
        try:
            found = solve_program(program).speed
        except SimulationError:
            assert apart >= 1e-6
            seen["refused"] += 1
            continue
        assert apart <= 1e-3 or contacts
        assert np.abs(speeds - found).max(axis=1).min() < 1e-6 * scale
        seen["one" if unique else "found by trying"] += 1
    assert seen["found by trying"] > (50 if contacts else 15)
    assert seen["refused"] > (2 if contacts else 7)
    assert seen["one"] > 15 or contacts


def test_the_guess_does_not_change_the_answer() -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        program, case = random_step(rng, 4)
        cold, warm = solve_program(program), solve_program(program, rng.normal(size=4))
        again, scale = solve_program(program, cold.impulse), 1.0 + np.abs(case.free).max()
        assert np.abs(cold.velocity - warm.velocity).max() < 1e-8 * scale
        assert np.abs(cold.velocity - again.velocity).max() < 1e-9 * scale
        assert again.iterations == 1
