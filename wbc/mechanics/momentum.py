"""Loops over the rows of a free base: its momentum at a velocity, its velocity at a momentum."""

from __future__ import annotations

import numpy as np

from wbc.compiled import Matrix, OutVector, Vector, compiled, local, view


@compiled(counted=False)
def _to_rows(turn: Matrix, lever: Vector, planar: bool, wrench: Vector, rows: OutVector) -> None:
    """Write a wrench (6,) about the centre of mass, world axes, as rows of the base (3 or 6)."""
    about = local(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        about[i] = wrench[3 + i] + lever[j] * wrench[k] - lever[k] * wrench[j]
    if planar:
        rows[0], rows[1], rows[2] = wrench[0], wrench[2], about[1]
        return
    for i in range(3):
        rows[i] = rows[3 + i] = 0.0
        for j in range(3):
            rows[i] += turn[j, i] * wrench[j]
            rows[3 + i] += turn[j, i] * about[j]


@compiled(counted=False)
def _solve(inertia: Matrix, first: int, rows: OutVector) -> None:
    """Solve H_bb x = rows in place (Cholesky)."""
    size = len(rows)
    factor, inverse = view(local(36), 0, 6, 6), local(6)  # one division per row: they are slow
    for i in range(size):
        for j in range(i):
            value = inertia[first + j, first + i]
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            factor[i, j] = value * inverse[j]
        value = inertia[first + i, first + i]
        for k in range(i):
            value -= factor[i, k] * factor[i, k]
        inverse[i] = 1.0 / np.sqrt(value)
    for i in range(size):
        for k in range(i):
            rows[i] -= factor[i, k] * rows[k]
        rows[i] *= inverse[i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            rows[i] -= factor[k, i] * rows[k]
        rows[i] *= inverse[i]


@compiled(counted=False)
def momentum_at(
    inertia: Matrix,
    turn: Matrix,
    lever: Vector,
    first: int,
    planar: bool,
    velocity: Vector,
    momentum: OutVector,
) -> None:
    """Write the momentum (6,) of the tree on a free base, angular about its centre of mass.

    Args:
        inertia: H (nv, nv), of which the upper half is read.
        turn: rotation (3, 3) of the base in the world.
        lever: (3,) from the base's origin to the centre of mass, world.
        first: row of the base's first coordinate.
        planar: whether its coordinates are x, z, pitch, and no free flyer's.
        velocity: v (nv,).
        momentum: (6,) to write, world axes.
    """
    rows = local(6)
    rows[:] = 0.0
    for i in range(3 if planar else 6):
        for j in range(len(velocity)):
            rows[i] += inertia[min(first + i, j), max(first + i, j)] * velocity[j]
    for i in range(6):
        momentum[i] = 0.0
    if planar:
        momentum[0], momentum[2] = rows[0], rows[1]
        momentum[4] = rows[2] - (lever[2] * momentum[0] - lever[0] * momentum[2])
        return
    for i in range(3):
        for j in range(3):
            momentum[i] += turn[i, j] * rows[j]
            momentum[3 + i] += turn[i, j] * rows[3 + j]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        momentum[3 + i] -= lever[j] * momentum[k] - lever[k] * momentum[j]


@compiled(counted=False)
def velocity_at(
    inertia: Matrix,
    turn: Matrix,
    lever: Vector,
    first: int,
    planar: bool,
    momentum: Vector,
    velocity: OutVector,
) -> None:
    """Write the base's rows of v (nv,) so that the tree has a momentum (6,); inverts `momentum_at`.

    The other rows of `velocity` are read. Arguments as in `momentum_at`.
    """
    size = 3 if planar else 6
    rows = local(6)[:size]
    _to_rows(turn, lever, planar, momentum, rows)
    for i in range(size):
        for j in range(len(velocity)):
            if j < first or j >= first + size:
                rows[i] -= inertia[min(first + i, j), max(first + i, j)] * velocity[j]
    _solve(inertia, first, rows)
    for i in range(size):
        velocity[first + i] = rows[i]


@compiled(counted=False)
def part_on_joints(
    inertia: Matrix,
    turn: Matrix,
    lever: Vector,
    first: int,
    planar: bool,
    weight: Vector,
    bias: OutVector,
) -> None:
    """Take out of the bias (nv,) what the momentum of a free base accounts for, in place.

    With the bias [b_b; b_j] and the rows g_b that hold the weight alone, an acceleration d_b of the
    base with H_bb d_b = b_b - g_b is due to the turning of coordinates alone. It is added to the
    motion: the bias becomes [g_b; b_j - H_jb d_b]. Arguments as in `momentum_at`, and

    Args:
        weight: -m g (3,) [N], world: what holds the tree up.
        bias: (nv,), changed.
    """
    size = 3 if planar else 6
    wrench, held, rows = local(6), local(6)[:size], local(6)[:size]
    for i in range(3):
        wrench[i], wrench[3 + i] = weight[i], 0.0
    _to_rows(turn, lever, planar, wrench, held)
    for i in range(size):
        rows[i] = bias[first + i] - held[i]
    _solve(inertia, first, rows)
    for j in range(len(bias)):
        if j < first or j >= first + size:
            for i in range(size):
                bias[j] -= inertia[min(first + i, j), max(first + i, j)] * rows[i]
    for i in range(size):
        bias[first + i] = held[i]
