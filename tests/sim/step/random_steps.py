"""Random step programs, in both the solver's and the brute force's form."""

from __future__ import annotations

import numpy as np

from tests.sim.step.brute_force import Case
from wbc.sim import StepProgram


def random_step(
    rng: np.random.Generator, gears: int, contacts: int = 0, locking: bool = False
) -> tuple[StepProgram, Case]:
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
    return StepProgram(inertia, free_velocity, rows, laws_of(case), targets, mu, 1), case


def laws_of(case: Case) -> np.ndarray:
    """Return the laws (m, 9) of the gears of a case, see `wbc.mechanics.rows.RowSystem`."""
    zero, brought, dry = np.zeros(len(case.brought)), case.brought, case.coulomb
    laws = brought - dry, brought + dry, case.inertia, 1.0 / case.eta_f, case.eta_b
    return np.column_stack((*laws, zero, zero, zero + np.inf, zero))
