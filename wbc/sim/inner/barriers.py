"""Gaps of limits and contact points on plane ground, and the rows of those that are closed."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Flags,
    Nothing,
    Number,
    OutDense,
    OutPlaces,
    OutRow,
    Places,
    Row,
    Table,
    compiled,
    local,
)
from wbc.sim.inner.tables import (
    OBSTACLES,
    PLACED,
    Obstacles,
    PlacedTree,
    point_of_reference,
)


@compiled(Nothing, OBSTACLES, Dense, Count, OutRow, counted=False)
def place_of(obstacles: Obstacles, poses: FloatArray, which: int, point: FloatArray) -> None:
    """Write the place (3,) of a contact point, world."""
    pose, own = poses[obstacles.contact_at[which, 0]], obstacles.contacts[which]
    for k in range(3):
        point[k] = (
            pose[9 + k] + pose[3 * k] * own[0] + pose[3 * k + 1] * own[1] + pose[3 * k + 2] * own[2]
        )


@compiled(Nothing, OBSTACLES, Row, Dense, OutRow, counted=False)
def gaps_at(obstacles: Obstacles, q: FloatArray, poses: FloatArray, gap: FloatArray) -> None:
    """Write all gaps (2 j + k s,): lower limits, upper limits, contact points solid by solid.

    Args:
        obstacles: limits, contact points and planes.
        q: (nq,).
        poses: (n, 12).
        gap: to write.
    """
    limit_at, limit_range = obstacles.limit_at, obstacles.limit_range
    contacts, solids = obstacles.contacts, obstacles.solids
    j, k = len(limit_at), len(contacts)
    for i in range(j):
        gap[i] = q[limit_at[i, 0]] - limit_range[i, 0]
        gap[j + i] = limit_range[i, 1] - q[limit_at[i, 0]]
    point = local(3)
    for i in range(k):
        place_of(obstacles, poses, i, point)
        for s in range(len(solids)):
            along = point[0] * solids[s, 0] + point[1] * solids[s, 1] + point[2] * solids[s, 2]
            gap[2 * j + s * k + i] = along - solids[s, 3] - contacts[i, 3]


@compiled(Nothing, OBSTACLES, Dense, Row, Count, Row, OutRow, counted=False)
def touching_from(
    obstacles: Obstacles,
    poses: FloatArray,
    about: FloatArray,
    contact: int,
    normal: FloatArray,
    lever: FloatArray,
) -> None:
    """Write the way (3,) from `about` to where a contact touches; a ball's is below its centre."""
    place_of(obstacles, poses, contact, lever)
    for k in range(3):
        lever[k] -= about[k] + obstacles.contacts[contact, 3] * normal[k]


@compiled(Nothing, Flags, Table, Table, OBSTACLES, PLACED, Row, OutRow, counted=False)
def rates_at(
    closed: BoolArray,
    rows: IntArray,
    bases: IntArray,
    obstacles: Obstacles,
    placed: PlacedTree,
    v: FloatArray,
    rate: FloatArray,
) -> None:
    """Write how fast the closed contacts open (2 j + c,) at v (nv,); zero for all else.

    Args:
        closed: (2 j + c,).
        rows: of the `Tree`.
        bases: free bases.
        obstacles: limits, contact points and planes.
        placed: the tree in its configuration.
        v: (nv,).
        rate: to write.
    """
    limits, columns = 2 * len(obstacles.limit_at), placed.columns
    contact_at, solids = obstacles.contact_at, obstacles.solids
    about = point_of_reference(bases, placed.poses)
    k, point, motion = len(contact_at), local(3), local(6)
    for b in range(len(closed)):
        rate[b] = 0.0
        if b < limits or not closed[b]:
            continue
        contact, normal = (b - limits) % k, solids[(b - limits) // k, :3]
        touching_from(obstacles, placed.poses, about, contact, normal, point)
        x, y, z = point[0], point[1], point[2]
        motion[:] = 0.0
        i = contact_at[contact, 1]
        while i >= 0:
            for a in range(6):
                motion[a] += columns[i, a] * v[i]
            i = rows[i, 1]
        rate[b] = normal[0] * (motion[0] + motion[4] * z - motion[5] * y)
        rate[b] += normal[1] * (motion[1] + motion[5] * x - motion[3] * z)
        rate[b] += normal[2] * (motion[2] + motion[3] * y - motion[4] * x)


@compiled(Nothing, Row, Flag, OutDense, counted=False)
def contact_axes(normal: FloatArray, planar: bool, axes: FloatArray) -> None:
    """Write the normal and one tangent in x-z, or two tangents, as unit vectors (1 + d, 3)."""
    x, y, z = normal[0], normal[1], normal[2]
    axes[0, 0], axes[0, 1], axes[0, 2] = x, y, z
    if planar:
        axes[1, 0], axes[1, 1], axes[1, 2] = z, 0.0, -x
        return
    # The world axis less its normal part: x, or y where x is nearly along the normal.
    if abs(x) < 0.9:
        a, b, c = 1.0 - x * x, -x * y, -x * z
    else:
        a, b, c = -y * x, 1.0 - y * y, -y * z
    size = np.sqrt(a * a + b * b + c * c)
    a, b, c = a / size, b / size, c / size
    axes[1, 0], axes[1, 1], axes[1, 2] = a, b, c
    axes[2, 0], axes[2, 1], axes[2, 2] = y * c - z * b, z * a - x * c, x * b - y * a


@compiled(
    Nothing,
    Flags,
    OBSTACLES,
    Table,
    Table,
    PLACED,
    Count,
    OutDense,
    OutDense,
    OutPlaces,
    counted=False,
)
def barrier_rows(
    closed: BoolArray,
    obstacles: Obstacles,
    rows: IntArray,
    bases: IntArray,
    placed: PlacedTree,
    first: int,
    matrix: FloatArray,
    axes: FloatArray,
    which: IntArray,
) -> None:
    """Write the rows of the closed barriers: limits, contact normals, contact tangents.

    Args:
        closed: (2 j + c,).
        obstacles: limits, contact points and planes.
        rows: of the `Tree`.
        bases: free bases.
        placed: the tree in its configuration.
        first: row of `matrix` at which they start.
        matrix: (r, nv) to write.
        axes: (closed contacts (1 + d), 3) to write.
        which: numbers of the closed contact barriers to write.
    """
    limit_at, contact_at, solids = obstacles.limit_at, obstacles.contact_at, obstacles.solids
    columns = placed.columns
    about = point_of_reference(bases, placed.poses)
    j, k, row, count = len(limit_at), len(contact_at), first, 0
    for i in range(2 * j):
        if closed[i]:
            matrix[row] = 0.0
            matrix[row, limit_at[i % j, 1]] = 1.0 if i < j else -1.0
            row += 1
    for i in range(2 * j, len(closed)):
        if closed[i]:
            which[count] = i - 2 * j
            count += 1
    size, point = 1 + obstacles.tangents, local(3)
    for c in range(count):
        contact, own = which[c] % k, axes[size * c : size * (c + 1)]
        normal = solids[which[c] // k, :3]
        contact_axes(normal, size == 2, own)
        touching_from(obstacles, placed.poses, about, contact, normal, point)
        x, y, z = point[0], point[1], point[2]
        for a in range(size):
            at = row + c if a == 0 else row + count + c * (size - 1) + a - 1
            matrix[at] = 0.0
            u, v, w = own[a, 0], own[a, 1], own[a, 2]
            p, q, r = y * w - z * v, z * u - x * w, x * v - y * u
            i = contact_at[contact, 1]
            while i >= 0:
                column = columns[i]
                matrix[at, i] = (
                    u * column[0]
                    + v * column[1]
                    + w * column[2]
                    + p * column[3]
                    + q * column[4]
                    + r * column[5]
                )
                i = rows[i, 1]


@compiled(
    Nothing, Flags, Flags, Row, Row, Number, OBSTACLES, Table, Table, PLACED, Row, Count,
    OutDense, OutDense, OutPlaces, OutRow, OutRow, OutRow, counted=False,
)  # fmt: skip
def held_rows(
    closed: BoolArray,
    kept: BoolArray,
    rate: FloatArray,
    speed: FloatArray,
    step: float,
    obstacles: Obstacles,
    rows: IntArray,
    bases: IntArray,
    placed: PlacedTree,
    middle: FloatArray,
    first: int,
    matrix: FloatArray,
    axes: FloatArray,
    which: IntArray,
    targets: FloatArray,
    frictions: FloatArray,
    gap: FloatArray,
) -> None:
    """Write the rows of the closed barriers, their lowest speeds and frictions.

    Args:
        closed: (2 j + c,).
        kept: (2 j + c,) barriers that may close within the part.
        rate: (2 j + c,) speed at which closed contacts opened at the start.
        speed: v (nv,) in the middle.
        step: h [s].
        obstacles, rows, bases, placed, first, matrix, axes, which: see `barrier_rows`.
        middle: q (nq,) in the middle.
        targets: (l + k,) to write.
        frictions: (k,) to write.
        gap: (2 j + c,) in the middle, to write where any barrier is closed.
    """
    if len(targets):
        gaps_at(obstacles, middle, placed.poses, gap)
        barrier_rows(closed, obstacles, rows, bases, placed, first, matrix, axes, which)
    row = 0
    for i in range(len(closed)):
        if closed[i]:
            targets[row] = 0.0
            if kept[i]:
                # It was kept ahead of its closing and may close, over the half step left.
                targets[row] = -2.0 / step * max(gap[i], 0.0)
            elif i >= 2 * len(obstacles.limit_at):
                # What it opened over the first half it closes over the second: `problem`.
                drifted = -rate[i]
                for c in range(len(speed)):
                    drifted += matrix[first + row, c] * speed[c]
                targets[row] = -max(drifted, 0.0)
            row += 1
    for c in range(len(frictions)):
        frictions[c] = obstacles.contacts[which[c] % len(obstacles.contacts), 4]


@compiled(Nothing, Row, Dense, Places, Count, OutDense, counted=False)
def world_pushes(
    solved: FloatArray, axes: FloatArray, which: IntArray, tangents: int, pushes: FloatArray
) -> None:
    """Write the impulse on every contact point (k, 3), world.

    Args:
        solved: normal impulses of the closed contacts, then their tangents' (c (1 + d),).
        axes: (c (1 + d), 3), see `barrier_rows`.
        which: (c,) numbers of the closed contact barriers.
        tangents: d.
        pushes: to write.
    """
    pushes[:] = 0.0
    count = len(which)
    for c in range(count):
        for x in range(3):
            push = solved[c] * axes[c * (1 + tangents), x]
            for a in range(tangents):
                along = axes[c * (1 + tangents) + 1 + a, x]
                push += solved[count + c * tangents + a] * along
            pushes[which[c] % len(pushes), x] += push
