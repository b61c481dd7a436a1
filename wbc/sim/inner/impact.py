"""An impact without restitution: barriers that are reached stop the robot at once."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Flags,
    Nothing,
    Number,
    OutDense,
    OutFlags,
    OutPlaces,
    OutRow,
    Row,
    compiled,
    several,
)
from wbc.sim.inner.barriers import barrier_rows, gaps_at, world_pushes
from wbc.sim.inner.motion import look
from wbc.sim.inner.program import BACKWARD, INERTIA, INVERSE, solve_rows
from wbc.sim.inner.tables import ACCURACY, TOUCH, opened
from wbc.sim.solve.linear import factor_inertia
from wbc.sim.tree.kinematics import place

UNSOLVED, APART, RESTING, HIT = range(4)
"""Newton found no solution; nothing is reached; reached without speed; an impact."""
MESH, CONTACT, USED, ROWS = range(4)
"""Numbers of an impact: losses of gears and contacts [J], linear systems solved, rows."""
_SLOW = 1e-9


@compiled(Nothing, Dense, Dense, Row, OutDense, counted=False)
def impact_laws(gears: FloatArray, gear_rows: FloatArray, v: FloatArray, laws: FloatArray) -> None:
    """Write the law (m, 9) of every gear in an impact, as `impact_elements` says.

    Args:
        gears: (m, 6), columns RATIO to BACKWARD.
        gear_rows: (m, nv) speed of the motor outputs per v.
        v: (nv,) before.
        laws: to write, see `element_piece`.
    """
    for i in range(len(gears)):
        brought = 0.0
        for j in range(len(v)):
            brought += gears[i, INERTIA] * gear_rows[i, j] * v[j]
        kept = gears[i, BACKWARD] / gears[i, INVERSE] * brought
        law = laws[i]
        law[0] = brought if brought > 0.0 else kept
        law[1] = brought if brought < 0.0 else kept
        law[2], law[3], law[4] = gears[i, INERTIA], gears[i, INVERSE], gears[i, BACKWARD]
        law[5] = law[6] = law[8] = 0.0
        law[7] = np.inf


@compiled(several(Number, Number), Dense, Dense, Dense, Row, Row, Row, counted=False)
def losses_of(
    inertia: FloatArray,
    gears: FloatArray,
    gear_rows: FloatArray,
    v: FloatArray,
    after: FloatArray,
    mesh: FloatArray,
) -> tuple[float, float]:
    """Return what an impact loses in the gears (`impact_mesh_loss`) and in the contacts [J].

    Args:
        inertia: H_l (nv, nv).
        gears: (m, 6), columns RATIO to BACKWARD.
        gear_rows: (m, nv) speed of the motor outputs per v.
        v, after: (nv,) before and after.
        mesh: (m,) impulses of the gears.
    """
    n, given, lost = len(v), 0.0, 0.0
    for i in range(n):
        for j in range(n):
            given += 0.5 * inertia[i, j] * (v[i] * v[j] - after[i] * after[j])
    for g in range(len(gears)):
        fast, slow = 0.0, 0.0
        for j in range(n):
            fast += gear_rows[g, j] * v[j]
            slow += gear_rows[g, j] * after[j]
        had, has = (0.5 * gears[g, INERTIA] * fast * fast, 0.5 * gears[g, INERTIA] * slow * slow)
        given += had - has
        if fast * slow < 0.0:
            backward = gears[g, BACKWARD] if gears[g, BACKWARD] > 0.0 else 1.0
            lost += (1.0 - 1.0 / gears[g, INVERSE]) * had + (1.0 / backward - 1.0) * has
        else:
            lost += had - has - 0.5 * mesh[g] * (fast + slow)
    return lost, given - lost


@compiled(Nothing, OutPlaces, OutRow, Row, OutRow, counted=False)
def gaps_of(whole: IntArray, numbers: FloatArray, q: FloatArray, gap: FloatArray) -> None:
    """Write all gaps (2 j + c,) at q (nq,); the plant as by `packed_plant`."""
    plant = opened(whole, numbers)
    place(plant.tree.joints, plant.tree.shapes, q, plant.placed.poses)
    gaps_at(plant.obstacles, q, plant.placed.poses, gap)


@compiled(
    Count, OutPlaces, OutRow, Flags, Row, Row, Number,
    OutRow, OutRow, OutRow, OutRow, OutFlags, OutFlags,
)  # fmt: skip
def impact_at(
    whole: IntArray,
    numbers: FloatArray,
    before: BoolArray,
    q: FloatArray,
    v: FloatArray,
    slow: float,
    after: FloatArray,
    pushes: FloatArray,
    impulse: FloatArray,
    found: FloatArray,
    fresh: BoolArray,
    closed: BoolArray,
) -> int:
    """Write the impact on barriers that have just been reached, see `settle`.

    Args:
        whole, numbers: the plant as by `packed_plant`.
        before: (2 j + c,) barriers that are known to be closed.
        q, v: (nq,), (nv,).
        slow: speed up to which barriers that part stay closed.
        after: v (nv,) to write.
        pushes: (3 k,) impulses on the contact points, world, to write.
        impulse: of the rows, one after the other, to write; more than there are.
        found: (4,) numbers MESH to ROWS to write.
        fresh: (2 j + c,) barriers that are reached, to write.
        closed: (2 j + c,) barriers that are closed afterwards, to write.

    Returns:
        UNSOLVED, APART, RESTING or HIT; of these only HIT writes speeds and impulses.
    """
    plant = opened(whole, numbers)
    tree, placed, gears, obstacles = plant.tree, plant.placed, plant.gears, plant.obstacles
    n, m, size, d = len(v), len(gears.rows), len(before), obstacles.tangents
    place(tree.joints, tree.shapes, q, placed.poses)
    gap = np.empty(size)
    gaps_at(obstacles, q, placed.poses, gap)
    both, touching, reached = 0, 0, False
    for i in range(size):
        fresh[i] = not before[i] and gap[i] <= plant.bounds[TOUCH]
        closed[i] = before[i] or fresh[i]
        reached = reached or fresh[i]
        both += closed[i]
        touching += closed[i] and i >= 2 * len(obstacles.limit_at)
    if not reached:
        return APART
    look(tree, plant.flight, n, placed)
    total = m + both + d * touching
    matrix, axes = np.empty((total, n)), np.empty((touching * (1 + d), 3))
    which, row, coming = np.empty(touching, dtype=np.int64), m, False
    barrier_rows(closed, obstacles, tree.rows, plant.flight.bases, placed, m, matrix, axes, which)
    for i in range(size):
        if closed[i]:
            speed = 0.0
            for c in range(n):
                speed += matrix[row, c] * v[c]
            coming = coming or (fresh[i] and speed < -_SLOW)
            row += 1
    if not coming:
        return RESTING
    lower, laws, frictions = np.empty((n, n)), np.empty((m, 9)), np.empty(touching)
    if not factor_inertia(placed.inertia, lower):
        return UNSOLVED
    impact_laws(gears.numbers, gears.rows, v, laws)
    for i in range(m):
        for c in range(n):
            matrix[i, c] = gears.rows[i, c]
    for c in range(touching):
        frictions[c] = obstacles.contacts[which[c] % len(obstacles.contacts), 4]
    solved, moved = np.zeros(total), np.zeros(total)
    used = solve_rows(
        matrix, lower, laws, np.zeros(both), frictions, d, v, np.zeros(total),
        plant.bounds[ACCURACY], solved, moved, after,
    )  # fmt: skip
    if used < 0:
        return UNSOLVED
    for i in range(total):
        impulse[i] = solved[i]
    world_pushes(solved[m + both - touching :], axes, which, d, pushes.reshape(-1, 3))
    found[MESH], found[CONTACT] = losses_of(
        placed.inertia, gears.numbers, gears.rows, v, after, solved[:m]
    )
    found[USED], found[ROWS], row = used, total, m
    for i in range(size):
        if closed[i]:
            closed[i] = moved[row] <= max(plant.bounds[TOUCH], slow)
            row += 1
    return HIT
