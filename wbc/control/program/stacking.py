"""Rows of tasks and contacts at one state, compiled."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Dense,
    Matrix,
    Nothing,
    OutDense,
    OutVector,
    Places,
    Table,
    Vector,
    compiled,
)
from wbc.control.kinematics.turning import place_turn
from wbc.fixed_arrays import FixedTable, array_at


@compiled(Nothing, Matrix, Vector, Places, OutVector)
def place_rates(
    jacobian: FloatArray, velocity: FloatArray, chosen: IntArray, rates: FloatArray
) -> None:
    """Write J v (k,) and below it the velocities of the chosen coordinates (c,) into `rates`."""
    rows = len(jacobian)
    for i in range(rows):
        rate = 0.0
        for j in range(len(velocity)):
            rate += jacobian[i, j] * velocity[j]
        rates[i] = rate
    for i in range(len(chosen)):
        rates[rows + i] = velocity[chosen[i]]


@compiled(
    Nothing,
    *(Vector, Vector, Table, Places, Dense, Dense, Matrix, Places, Places, Vector),
    *(OutDense, Dense, Vector, OutVector, OutVector),
)
def place_wanted(
    position: FloatArray,
    velocity: FloatArray,
    plan: IntArray,
    used: IntArray,
    places: FloatArray,
    targets: FloatArray,
    jacobian: FloatArray,
    chosen: IntArray,
    positions: IntArray,
    goals: FloatArray,
    parts: FloatArray,
    gains: FloatArray,
    weight: FloatArray,
    wanted: FloatArray,
    pull: FloatArray,
) -> None:
    """Write what all tasks want (k + c,): the sum of gains * parts over their first axis.

    Errors of frames and joints, and all rates, are written into `parts` first. The last c rows, of
    the chosen coordinates, are summed by weight (c,) into `pull` (nv,).

    Args:
        position, velocity: q (nq,) and v (nv,).
        plan, used, places: of the `FrameTable` (e, ..).
        targets: placements wanted, (e, 12) or more.
        jacobian: J (k, nv).
        chosen: coordinates of the last rows (c,).
        positions, goals: where those rows find their position in q, -1 where their task says it
            itself, and where it should be (c,).
        parts, gains: (5, k + c) error, rate, drift, velocity and acceleration.
        weight: (c,).
        wanted, pull: results.
    """
    total = len(wanted)
    rows = total - len(chosen)
    turn = np.empty(3)
    for e in range(len(plan)):
        if used[e] == 0:
            continue
        row, begin, count, step = plan[e, 2], plan[e, 3], plan[e, 4], plan[e, 5]
        if begin + (count - 1) * step >= 3:
            place_turn(places[e], targets[e], turn)
        for k in range(count):
            a = begin + k * step
            parts[0, row + k] = targets[e, 9 + a] - places[e, 9 + a] if a < 3 else turn[a - 3]
    for i in range(rows):
        rate = 0.0
        for j in range(len(velocity)):
            rate += jacobian[i, j] * velocity[j]
        parts[1, i] = rate
    for i in range(len(chosen)):
        parts[1, rows + i] = velocity[chosen[i]]
        if positions[i] >= 0:
            parts[0, rows + i] = goals[i] - position[positions[i]]
    for i in range(total):
        wanted[i] = 0.0
    for part in range(len(parts)):
        for i in range(total):
            wanted[i] += gains[part, i] * parts[part, i]
    pull[:] = 0.0
    for i in range(len(chosen)):
        pull[chosen[i]] += weight[i] * wanted[rows + i]


@compiled(Nothing, Matrix, Vector, Vector, Vector, OutVector)
def place_rest(
    jacobian: FloatArray,
    velocity: FloatArray,
    damping: FloatArray,
    drift: FloatArray,
    target: FloatArray,
) -> None:
    """Write -damping J v - drift (k,), the acceleration that brings rows to rest, into `target`."""
    for i in range(len(target)):
        rate = 0.0
        for j in range(len(velocity)):
            rate += jacobian[i, j] * velocity[j]
        target[i] = -damping[i] * rate - drift[i]


STACK = (
    *(Table, Places, Dense, Dense, Matrix, Places, Places),
    *(Vector, OutDense, Dense, Vector, OutVector, OutVector),
)
"""Kinds of the arrays of `place_wanted` but position and velocity, in its order."""


@compiled(Nothing, FixedTable, Vector, Vector)
def want(memory: IntArray, position: FloatArray, velocity: FloatArray) -> None:
    """Do as `place_wanted` does in the memory of STACK."""
    place_wanted(
        position,
        velocity,
        array_at(memory, 0, Table),
        array_at(memory, 1, Places),
        array_at(memory, 2, Dense),
        array_at(memory, 3, Dense),
        array_at(memory, 4, Matrix),
        array_at(memory, 5, Places),
        array_at(memory, 6, Places),
        array_at(memory, 7, Vector),
        array_at(memory, 8, OutDense),
        array_at(memory, 9, Dense),
        array_at(memory, 10, Vector),
        array_at(memory, 11, OutVector),
        array_at(memory, 12, OutVector),
    )


REST = Matrix, Vector, Vector, OutVector
"""Kinds of the arrays of `place_rest` but the velocity, in its order."""


@compiled(Nothing, FixedTable, Vector)
def rest(memory: IntArray, velocity: FloatArray) -> None:
    """Do as `place_rest` does in the memory of REST."""
    place_rest(
        array_at(memory, 0, Matrix),
        velocity,
        array_at(memory, 1, Vector),
        array_at(memory, 2, Vector),
        array_at(memory, 3, OutVector),
    )
