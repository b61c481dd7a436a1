"""A step as a program of its own: any inertia, any rows, solved as the plant solves its steps."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc.errors import SimulationError
from wbc.mechanics.linear import factor_inertia
from wbc.mechanics.newton import SEVERAL, UNSOLVED, WAYS, residuals, velocity_after
from wbc.mechanics.rows import system_of
from wbc.sim.step.self_locking import solve_rows


@dataclass(frozen=True)
class Program:
    """Find v with H (v - v_free) = G' impulse, every row of G on its law, see `RowSystem`.

    The rows are m elements with a law, normals whose speed is not below its target, and d tangents
    per contact.
    """

    inertia: np.ndarray
    free_velocity: np.ndarray
    rows: np.ndarray
    laws: np.ndarray
    targets: np.ndarray
    frictions: np.ndarray
    tangents: int


class Solution(NamedTuple):
    """Velocity (n,); of the rows (r,) impulse, speed, distance from the law; and the work."""

    velocity: np.ndarray
    impulse: np.ndarray
    speed: np.ndarray
    residuals: np.ndarray
    iterations: int
    method: str


def solve_program(program: Program, guess: np.ndarray | None = None) -> Solution:
    """Return the solution that the plant takes, from the impulses of a step before or none."""
    own, lower, size = program, np.empty(program.inertia.shape), len(program.rows)
    assert factor_inertia(own.inertia, lower)
    laws = np.ascontiguousarray(own.laws)
    row_numbers = own.rows, lower, own.free_velocity, laws, own.targets, own.frictions
    system = system_of(*row_numbers, own.tangents)
    start = np.zeros(size) if guess is None else guess
    impulse, velocity = np.empty(size), np.empty(len(lower))
    used, way = solve_rows(system, start, 1.0, impulse)
    if way >= UNSOLVED:
        raise SimulationError("several solutions" if way == SEVERAL else "no solution")
    velocity_after(system, lower, own.free_velocity, impulse, velocity)
    _, off, speed = residuals(system, impulse)
    return Solution(velocity, impulse, speed, np.abs(off), used, WAYS[way])
