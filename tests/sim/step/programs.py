"""A step as a program of its own: any inertia, any rows, solved as the plant solves its steps."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled
from wbc.errors import SimulationError
from wbc.mechanics.linear import factor_inertia, rest_of_way
from wbc.mechanics.memory import Heap
from wbc.mechanics.newton import HOLD, SEVERAL, UNSOLVED, WAYS, look_at, speeds_at
from wbc.mechanics.rows import room_for, system_of
from wbc.sim.step.self_locking import solve_rows
from wbc.structures import stored


@dataclass(frozen=True)
class Program:
    """Find v with H (v - v_free) = G' impulse, every row of G on its law, see `RowSystem`.

    The rows are m elements with a law, normals whose speed is not below its target, and one or two
    tangents of each contact, or none; the others do not move.
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


@compiled
def _solved(
    heap: Heap,
    inertia: Dense,
    free: Row,
    matrix: Dense,
    laws: OutDense,
    targets: OutRow,
    frictions: OutRow,
    start: Row,
    found: OutDense,
    velocity: OutRow,
) -> tuple[int, int]:
    """Write impulses, speeds and residuals (3, r), and the velocity; return work and method."""
    lower = np.empty(inertia.shape)
    if not factor_inertia(inertia, lower):
        return 0, UNSOLVED
    none = np.empty((0, 9))
    system = system_of(heap, matrix, lower, free, laws, none, targets, frictions)
    used, way = solve_rows(system, start, 1.0, found[0])
    speeds_at(system, found[0], velocity, found[1])
    rest_of_way(lower, velocity)
    velocity += free
    room = room_for(system)
    look_at(system, HOLD, found[0], room)
    found[2] = np.abs(room.off)
    return used, way


def solve_program(program: Program, guess: np.ndarray | None = None) -> Solution:
    """Return the solution that the plant takes, from the impulses of a step before or none."""
    own, k, n = program, len(program.frictions), len(program.inertia)
    first = len(own.rows) - own.tangents * k
    tangents = first + 2 * np.arange(k)[:, None] + np.arange(own.tangents)
    at, size = np.concatenate((np.arange(first), tangents.ravel())), first + 2 * k
    rows, start = np.zeros((size, n)), np.zeros(size)
    rows[at] = own.rows
    start[at] = 0.0 if guess is None else guess
    words = np.empty(10 * (size + n) * (n + 100))
    heap = stored(Heap(words, words.view(np.int64), np.zeros(2, np.int64), 0))
    found, velocity = np.empty((3, size)), np.empty(n)
    rest = np.array(own.laws), np.array(own.targets), np.array(own.frictions), start
    arrays = own.inertia, own.free_velocity, rows
    used, way = _solved(heap, *map(np.ascontiguousarray, arrays), *rest, found, velocity)
    if way >= UNSOLVED:
        raise SimulationError("several solutions" if way == SEVERAL else "no solution")
    return Solution(velocity, *found[:, at], used, WAYS[way])
