"""Velocities and drifts of all joints of a tree from its world Jacobian, compiled."""

from __future__ import annotations

from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutVector,
    Places,
    Vector,
    compiled,
)
from wbc.fixed_arrays import FixedTable, array_at


@compiled(types.UniTuple(Number, 3), Dense, Count, *[Number] * 3)
def _own(places: FloatArray, i: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a world vector in the axes of a placement."""
    return (
        places[i, 0] * x + places[i, 1] * y + places[i, 2] * z,
        places[i, 3] * x + places[i, 4] * y + places[i, 5] * z,
        places[i, 6] * x + places[i, 7] * y + places[i, 8] * z,
    )


@compiled(
    Nothing,
    *(Matrix, Dense, Vector, Places, Places, Places, Vector, Dense, Dense, Vector),
    *(OutDense, OutDense, OutVector, OutDense, OutVector),
)
def place_joint_motion(
    jacobian: FloatArray,
    places: FloatArray,
    velocity: FloatArray,
    parents: IntArray,
    first: IntArray,
    width: IntArray,
    masses: FloatArray,
    levers: FloatArray,
    inertias: FloatArray,
    gravity: FloatArray,
    rates: FloatArray,
    drifts: FloatArray,
    com_drift: FloatArray,
    forces: FloatArray,
    bias: FloatArray,
) -> None:
    """Write the spatial velocity V and drift A = dJ/dt v of every joint, and what follows.

    All are of world axes, taken at the world's origin, linear over angular. A column of the world
    Jacobian whose axis is fixed in its body turns with it, dJ_j/dt = V x J_j, so that along the
    tree (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 2.11)

        V_i = V_parent + J_i v_i,    A_i = A_parent + V_i x (J_i v_i).

    With the centre of mass c and the inertia I of a body about it, what it takes to move it so is
    the force m (c'' - g) there and the torque I alpha + w x I w; the bias of a coordinate is its
    column of J times the sum of both over all bodies that it moves.

    Args:
        jacobian: J (6, nv) of all joints.
        places: rotation, column by column, and translation of every joint (j, 12).
        velocity: v (nv,).
        parents, first, width: of every joint (j,): its parent, and its columns of J.
        masses, levers: of every body (j,) [kg] and (j, 3) [m], in its joint's frame.
        inertias: xx, xy, xz, yy, yz, zz about the centre of mass (j, 6) [kg m^2], likewise.
        gravity: (3,) [m/s^2].
        rates, drifts: results V and A (j, 6).
        com_drift: result dJ_com/dt v (3,) [m/s^2].
        forces: memory (j, 6).
        bias: result c_l (nv,) [N m, N].
    """
    total, ax, ay, az = 0.0, 0.0, 0.0, 0.0
    forces[:] = 0.0
    for i in range(1, len(parents)):
        parent = parents[i]
        s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(first[i], first[i] + width[i]):
            rate = velocity[j]
            s0 += jacobian[0, j] * rate
            s1 += jacobian[1, j] * rate
            s2 += jacobian[2, j] * rate
            s3 += jacobian[3, j] * rate
            s4 += jacobian[4, j] * rate
            s5 += jacobian[5, j] * rate
        vx, vy, vz = rates[parent, 0] + s0, rates[parent, 1] + s1, rates[parent, 2] + s2
        wx, wy, wz = rates[parent, 3] + s3, rates[parent, 4] + s4, rates[parent, 5] + s5
        rates[i, 0], rates[i, 1], rates[i, 2] = vx, vy, vz
        rates[i, 3], rates[i, 4], rates[i, 5] = wx, wy, wz
        d0 = drifts[parent, 0] + wy * s2 - wz * s1 + vy * s5 - vz * s4
        d1 = drifts[parent, 1] + wz * s0 - wx * s2 + vz * s3 - vx * s5
        d2 = drifts[parent, 2] + wx * s1 - wy * s0 + vx * s4 - vy * s3
        d3 = drifts[parent, 3] + wy * s5 - wz * s4
        d4 = drifts[parent, 4] + wz * s3 - wx * s5
        d5 = drifts[parent, 5] + wx * s4 - wy * s3
        drifts[i, 0], drifts[i, 1], drifts[i, 2] = d0, d1, d2
        drifts[i, 3], drifts[i, 4], drifts[i, 5] = d3, d4, d5
        mass = masses[i]
        if mass > 0.0 or inertias[i, 0] + inertias[i, 3] + inertias[i, 5] > 0.0:
            lx, ly, lz = levers[i, 0], levers[i, 1], levers[i, 2]
            px = places[i, 9] + places[i, 0] * lx + places[i, 3] * ly + places[i, 6] * lz
            py = places[i, 10] + places[i, 1] * lx + places[i, 4] * ly + places[i, 7] * lz
            pz = places[i, 11] + places[i, 2] * lx + places[i, 5] * ly + places[i, 8] * lz
            ux, uy, uz = vx + wy * pz - wz * py, vy + wz * px - wx * pz, vz + wx * py - wy * px
            cx = d0 + d4 * pz - d5 * py + wy * uz - wz * uy
            cy = d1 + d5 * px - d3 * pz + wz * ux - wx * uz
            cz = d2 + d3 * py - d4 * px + wx * uy - wy * ux
            ax += mass * cx
            ay += mass * cy
            az += mass * cz
            total += mass
            fx, fy, fz = (
                mass * (cx - gravity[0]),
                mass * (cy - gravity[1]),
                mass * (cz - gravity[2]),
            )
            # w and alpha in the body's axes, where its inertia is known
            w0, w1, w2 = _own(places, i, wx, wy, wz)
            a0, a1, a2 = _own(places, i, d3, d4, d5)
            xx, xy, xz = inertias[i, 0], inertias[i, 1], inertias[i, 2]
            yy, yz, zz = inertias[i, 3], inertias[i, 4], inertias[i, 5]
            h0 = xx * w0 + xy * w1 + xz * w2
            h1 = xy * w0 + yy * w1 + yz * w2
            h2 = xz * w0 + yz * w1 + zz * w2
            n0 = xx * a0 + xy * a1 + xz * a2 + w1 * h2 - w2 * h1
            n1 = xy * a0 + yy * a1 + yz * a2 + w2 * h0 - w0 * h2
            n2 = xz * a0 + yz * a1 + zz * a2 + w0 * h1 - w1 * h0
            forces[i, 0], forces[i, 1], forces[i, 2] = fx, fy, fz
            for row in range(3):
                turned = places[i, row] * n0 + places[i, 3 + row] * n1 + places[i, 6 + row] * n2
                forces[i, 3 + row] = turned
            forces[i, 3] += py * fz - pz * fy
            forces[i, 4] += pz * fx - px * fz
            forces[i, 5] += px * fy - py * fx
    for i in range(len(parents) - 1, 0, -1):
        for j in range(first[i], first[i] + width[i]):
            needed = 0.0
            for k in range(6):
                needed += jacobian[k, j] * forces[i, k]
            bias[j] = needed
        for k in range(6):
            forces[parents[i], k] += forces[i, k]
    if total > 0.0:
        com_drift[0], com_drift[1], com_drift[2] = ax / total, ay / total, az / total


TREE = (
    Matrix,
    Dense,
    Places,
    Places,
    Places,
    Vector,
    Dense,
    Dense,
    Vector,
    OutDense,
    OutDense,
    OutVector,
    OutDense,
    OutVector,
)
"""Kinds of the arrays of `place_joint_motion` but the velocity, in its order."""


@compiled(Nothing, FixedTable, Vector)
def move_joints(memory: IntArray, velocity: FloatArray) -> None:
    """Do as `place_joint_motion` does in the memory of TREE."""
    place_joint_motion(
        array_at(memory, 0, Matrix),
        array_at(memory, 1, Dense),
        velocity,
        array_at(memory, 2, Places),
        array_at(memory, 3, Places),
        array_at(memory, 4, Places),
        array_at(memory, 5, Vector),
        array_at(memory, 6, Dense),
        array_at(memory, 7, Dense),
        array_at(memory, 8, Vector),
        array_at(memory, 9, OutDense),
        array_at(memory, 10, OutDense),
        array_at(memory, 11, OutVector),
        array_at(memory, 12, OutDense),
        array_at(memory, 13, OutVector),
    )
