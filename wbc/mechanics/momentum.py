"""The momentum of a tree on a free base: at a velocity, and the base's velocity at a momentum.

A base is some first rows of a tree, six of a free flyer or three of a planar one. Momenta (6,) are
linear and angular about the tree's centre of mass, world axes.
"""

from __future__ import annotations

from wbc.compiled import Dense, OutRow, Row, inner, local, view
from wbc.mechanics.inertia import momentum_of
from wbc.mechanics.linear import copy_to, dot, factor_inertia, halfway, rest_of_way
from wbc.mechanics.tree import Tree


@inner
def _to_point(composite: Row, sign: float, wrench: OutRow) -> None:
    """Move a wrench (6,) from the centre of mass to the point of `columns_at`; back with -1."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turning = composite[1 + j] * wrench[k] - composite[1 + k] * wrench[j]
        wrench[3 + i] += sign / composite[0] * turning


@inner
def _solve(block: Dense, rows: OutRow) -> None:
    """Solve H_bb x = rows in place; the lower half of H_bb (b, b) is read."""
    size = len(rows)
    lower = view(local(36), 0, size, size)
    factor_inertia(block, lower)
    halfway(lower, rows.reshape(-1, 1))
    rest_of_way(lower, rows)


@inner
def momentum_at(
    tree: Tree, columns: Dense, composite: Dense, root: int, velocity: Row, momentum: OutRow
) -> None:
    """Write the momentum (6,) of the tree behind a joint.

    Args:
        tree: with the joint.
        columns: (nv, 6), see `columns_at`.
        composite: (n, 10), see `composites_of`.
        root: number of the joint, the root of its tree.
        velocity: v (nv,).
        momentum: to write.
    """
    own = local(6)
    momentum[:] = 0.0
    for row in range(len(velocity)):
        joint = tree.rows[row, 0]
        if tree.joints[joint, 4] == root:
            momentum_of(composite[joint], columns[row], own)
            for k in range(6):
                momentum[k] += own[k] * velocity[row]
    _to_point(composite[root], -1.0, momentum)


@inner
def velocity_at(
    tree: Tree,
    columns: Dense,
    composite: Dense,
    root: int,
    first: int,
    size: int,
    momentum: Row,
    velocity: OutRow,
) -> None:
    """Write the base's rows of v (nv,) so that the tree has a momentum (6,); inverts `momentum_at`.

    The other rows of `velocity` are read. Arguments as in `momentum_at`, and

    Args:
        first, size: rows of the base.
        momentum: (6,).
        velocity: to change.
    """
    left, own, rows = local(6), local(6), local(6)[:size]
    block = view(local(36), 0, size, size)
    copy_to(momentum, left)
    _to_point(composite[root], 1.0, left)
    for row in range(len(velocity)):
        joint = tree.rows[row, 0]
        if tree.joints[joint, 4] != root:
            continue
        momentum_of(composite[joint], columns[row], own)
        if first <= row < first + size:
            for i in range(size):
                block[row - first, i] = dot(own, columns[first + i])
        else:
            for k in range(6):
                left[k] -= own[k] * velocity[row]
    for i in range(size):
        rows[i] = dot(columns[first + i], left)
    _solve(block, rows)
    for i in range(size):
        velocity[first + i] = rows[i]


@inner
def part_on_joints(
    inertia: Dense,
    columns: Dense,
    composite: Row,
    first: int,
    size: int,
    weight: Row,
    bias: OutRow,
) -> None:
    """Take out of the bias (nv,) what the momentum of a free base accounts for, in place.

    With the bias [b_b; b_j] and the rows g_b that hold the weight alone, an acceleration d_b of the
    base with H_bb d_b = b_b - g_b is due to the turning of coordinates alone. It is added to the
    motion: the bias becomes [g_b; b_j - H_jb d_b].

    Args:
        inertia: H (nv, nv).
        columns: (nv, 6), see `columns_at`.
        composite: (10,) of the whole tree, see `composites_of`.
        first, size: rows of the base.
        weight: -m g and zeros (6,) [N], world: what holds the tree up.
        bias: (nv,), changed.
    """
    about, rows, block = local(6), local(6)[:size], view(local(36), 0, size, size)
    copy_to(weight, about)
    _to_point(composite, 1.0, about)
    for i in range(size):
        held = dot(columns[first + i], about)
        rows[i], bias[first + i] = bias[first + i] - held, held
        for k in range(size):
            block[i, k] = inertia[first + i, first + k]
    _solve(block, rows)
    for j in range(len(bias)):
        if j < first or j >= first + size:
            for i in range(size):
                bias[j] -= inertia[first + i, j] * rows[i]
