"""Inertia, velocity terms and momentum of a tree (composite bodies, Newton-Euler).

A base is some first rows of a tree, six of a free flyer or three of a planar one. Momenta (6,) are
linear and angular about the tree's centre of mass, world axes.
"""

from __future__ import annotations

from wbc.compiled import Dense, OutDense, OutRow, Places, Row, Table, compiled, inner, local, view
from wbc.mechanics.kinematics import FIRST, JOINT, ROWS, Tree, placed_at, product
from wbc.mechanics.linear import add_cross, add_times, copy_to, dot, factor_inertia, solve_inertia


@inner
def momentum_of(body: Row, motion: Row, momentum: OutRow) -> None:
    """Write the momentum (6,) of a body (10,) with a spatial velocity (6,)."""
    m, x, y, z = body[0], body[1], body[2], body[3]
    a, b, c, p, q, r = motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]
    momentum[0] = m * a + q * z - r * y
    momentum[1] = m * b + r * x - p * z
    momentum[2] = m * c + p * y - q * x
    momentum[3] = y * c - z * b + body[4] * p + body[5] * q + body[6] * r
    momentum[4] = z * a - x * c + body[5] * p + body[7] * q + body[8] * r
    momentum[5] = x * b - y * a + body[6] * p + body[8] * q + body[9] * r


@compiled(counted=False)
def bodies_at(joints: Table, shapes: Dense, poses: Dense, about: Row, bodies: OutDense) -> None:
    """Write `bodies` (n, 10) of a `Tree` with `poses` (n, 12), about a point (3,) in the world.

    Each is mass, first moment (3) and inertia (xx, xy, xz, yy, yz, zz), in world axes.
    """
    place, part = local(3), local(9)
    for i in range(len(joints)):
        pose, shape, body, at = poses[i], shapes[i], bodies[i], 4
        mass = body[0] = shape[15]
        placed_at(pose, shape[16:19], place)
        add_times(-1.0, about, place)
        product(pose, shape[19:], part)
        square = dot(place, place)
        for a in range(3):
            x, y, z = part[3 * a], part[3 * a + 1], part[3 * a + 2]
            moment = body[1 + a] = mass * place[a]
            for b in range(a, 3):
                turned = x * pose[3 * b] + y * pose[3 * b + 1] + z * pose[3 * b + 2]
                body[at] = turned - moment * place[b] + (mass * square if a == b else 0.0)
                at += 1


@compiled(counted=False)
def composites_of(joints: Table, bodies: Dense, composite: OutDense) -> None:
    """Write the sums (n, 10) of `bodies_at` over the tree behind each joint."""
    for i in range(len(joints)):
        copy_to(bodies[i], composite[i])
    for i in range(len(joints) - 1, -1, -1):
        if joints[i, 0] >= 0:
            add_times(1.0, composite[i], composite[joints[i, 0]])


@compiled(counted=False)
def inertia_at(rows: Table, composite: Dense, columns: Dense, inertia: OutDense) -> None:
    """Write H_l (nv, nv), both halves, of composite bodies (n, 10) and columns (nv, 6)."""
    force = local(6)
    inertia[:] = 0.0
    for j in range(len(rows)):
        momentum_of(composite[rows[j, 0]], columns[j], force)
        i = j
        while i >= 0:
            inertia[i, j] = inertia[j, i] = dot(force, columns[i])
            i = rows[i, 1]


@inner
def motion_at(joints: Table, columns: Dense, v: Row, motion: OutDense) -> None:
    """Write the spatial velocity (n, 6) of each body at v (nv,): V_i = V_parent + S_i v_i."""
    for i in range(len(joints)):
        parent = joints[i, 0]
        last = joints[i + 1, 3] if i + 1 < len(joints) else len(v)
        for k in range(6):
            motion[i, k] = motion[parent, k] if parent >= 0 else 0.0
            for row in range(joints[i, 3], last):
                motion[i, k] += columns[row, k] * v[row]


@compiled
def move_bodies(
    joints: Table,
    gravity: Row,
    columns: Dense,
    bodies: Dense,
    v: Row,
    motion: OutDense,
    drift: OutDense,
    force: OutDense,
    bias: OutRow,
) -> None:
    """Write how bodies move at v, and the forces that hold the tree at v' = 0.

    A column whose axis is fixed in its body turns with it, dS_j/dt = V x S_j, so that along the
    tree (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 2.11)

        V_i = V_parent + S_i v_i,    A_i = A_parent + V_i x (S_i v_i).

    The force on a body is I_i (A_i - g) + V_i x* I_i V_i; the bias of a row of v is its column
    times the sum of the forces on all bodies that it moves.

    Args:
        joints: (n, 5) of the `Tree`.
        gravity: (3,).
        columns: (nv, 6).
        bodies: (n, 10), of each body alone.
        v: (nv,).
        motion, drift: V and A (n, 6) to write.
        force: (n, 6) to write, of all behind each joint.
        bias: (nv,) to write.
    """
    count, own, part = len(joints), local(6), local(6)
    motion_at(joints, columns, v, motion)
    for i in range(count):
        parent, turning, moved = joints[i, 0], motion[i, 3:], drift[i]
        for k in range(6):
            own[k] = motion[i, k] - (motion[parent, k] if parent >= 0 else 0.0)
            moved[k] = drift[parent, k] if parent >= 0 else 0.0
        # V x S v, and below V x* I V
        add_cross(1.0, turning, own[:3], moved[:3])
        add_cross(1.0, motion[i, :3], own[3:], moved[:3])
        add_cross(1.0, turning, own[3:], moved[3:])
        for k in range(6):
            part[k] = moved[k] - (gravity[k] if k < 3 else 0.0)
        momentum_of(bodies[i], part, force[i])
        momentum_of(bodies[i], motion[i], part)
        add_cross(1.0, turning, part[:3], force[i, :3])
        add_cross(1.0, turning, part[3:], force[i, 3:])
        add_cross(1.0, motion[i, :3], part[:3], force[i, 3:])
    for i in range(count - 1, -1, -1):
        parent, first = joints[i, 0], joints[i, 3]
        last = joints[i + 1, 3] if i + 1 < count else len(v)
        for row in range(first, last):
            bias[row] = dot(columns[row], force[i])
        if parent >= 0:
            add_times(1.0, force[i], force[parent])


@inner
def _to_point(composite: Row, sign: float, wrench: OutRow) -> None:
    """Move a wrench (6,) from the centre of mass to the point of `columns_at`; back with -1."""
    add_cross(sign / composite[0], composite[1:4], wrench[:3], wrench[3:])


@inner
def momentum_at(
    tree: Tree, columns: Dense, composite: Dense, root: int, velocity: Row, momentum: OutRow
) -> None:
    """Write the momentum (6,) at v (nv,) of the tree behind the joint `root`.

    The columns (nv, 6) are of `columns_at`, the composite bodies (n, 10) of `composites_of`.
    """
    own = local(6)
    momentum[:] = 0.0
    for row in range(len(velocity)):
        joint = tree.rows[row, 0]
        if tree.joints[joint, 4] == root:
            momentum_of(composite[joint], columns[row], own)
            add_times(velocity[row], own, momentum)
    _to_point(composite[root], -1.0, momentum)


@inner
def _moves(columns: Dense, body: Row, base: Places, momentum: Row, rows: OutRow) -> None:
    """Write the base's rows (b,) with which a body (10,) has a momentum (6,) about its point.

    A planar base has the parts of it in x-z alone.
    """
    first, size, own = base[FIRST], base[ROWS], local(6)
    inertia = view(local(36), 0, size, size)
    for i in range(size):
        rows[i] = dot(columns[first + i], momentum)
        momentum_of(body, columns[first + i], own)
        for j in range(i + 1):
            inertia[i, j] = dot(own, columns[first + j])
    factor_inertia(inertia, inertia)
    solve_inertia(inertia, rows[:size])


@inner
def velocity_at(
    tree: Tree, columns: Dense, composite: Dense, base: Places, momentum: Row, velocity: OutRow
) -> None:
    """Write the rows of v (nv,) of a base (5,), at JOINT to PLACES, whose tree has a momentum (6,).

    The other rows of v are read; arguments as of `momentum_at`.
    """
    root, first, size = base[JOINT], base[FIRST], base[ROWS]
    left, own = local(6), local(6)
    copy_to(momentum, left)
    _to_point(composite[root], 1.0, left)
    for row in range(len(velocity)):
        joint = tree.rows[row, 0]
        if tree.joints[joint, 4] == root and not first <= row < first + size:
            momentum_of(composite[joint], columns[row], own)
            add_times(-velocity[row], own, left)
    _moves(columns, composite[root], base, left, velocity[first:])


@inner
def part_on_joints(
    tree: Tree,
    columns: Dense,
    composite: Dense,
    base: Places,
    inertia: Dense,
    force: Row,
    bias: OutRow,
) -> None:
    """Take out of the bias (nv,) what the momentum of a free base accounts for, in place.

    With the bias [b_b; b_j] and the rows g_b that hold the weight alone, an acceleration d_b of the
    base with H_bb d_b = b_b - g_b is due to the turning of coordinates alone. It is added to the
    motion: the bias becomes [g_b; b_j - H_jb d_b]. The force (6,) is that of all bodies of the tree
    (`move_bodies`); other arguments as of `velocity_at`.
    """
    first, size, whole = base[FIRST], base[ROWS], composite[base[JOINT]]
    weight, rest, rows = local(6), local(6), local(6)
    weight[:] = 0.0
    add_times(-whole[0], tree.gravity, weight)
    _to_point(whole, 1.0, weight)
    for i in range(size):
        bias[first + i] = dot(columns[first + i], weight)
    copy_to(force, rest)
    add_times(-1.0, weight, rest)
    _moves(columns, whole, base, rest, rows)
    for j in range(len(bias)):
        if j < first or j >= first + size:
            for i in range(size):
                bias[j] -= inertia[first + i, j] * rows[i]
