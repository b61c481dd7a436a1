"""Velocities and drifts of all joints of a tree from its world Jacobian, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Dense, Matrix, Nothing, OutDense, OutVector, Places, Vector, compiled


@compiled(
    Nothing,
    *(Matrix, Dense, Vector, Places, Places, Places, Vector, Dense),
    *(OutDense, OutDense, OutVector),
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
    rates: FloatArray,
    drifts: FloatArray,
    com_drift: FloatArray,
) -> None:
    """Write the spatial velocity V and drift A = dJ/dt v of every joint, and that of the CoM.

    All are of world axes, taken at the world's origin, linear over angular. A column of the world
    Jacobian whose axis is fixed in its body turns with it, dJ_j/dt = V x J_j, so that along the
    tree (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 2.11)

        V_i = V_parent + J_i v_i,    A_i = A_parent + V_i x (J_i v_i).

    Args:
        jacobian: J (6, nv) of all joints.
        places: rotation, column by column, and translation of every joint (j, 12).
        velocity: v (nv,).
        parents, first, width: of every joint (j,): its parent, and its columns of J.
        masses, levers: of every body (j,) [kg] and (j, 3) [m], in its joint's frame.
        rates, drifts: results V and A (j, 6).
        com_drift: result dJ_com/dt v (3,) [m/s^2].
    """
    total, ax, ay, az = 0.0, 0.0, 0.0, 0.0
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
        if mass > 0.0:
            lx, ly, lz = levers[i, 0], levers[i, 1], levers[i, 2]
            px = places[i, 9] + places[i, 0] * lx + places[i, 3] * ly + places[i, 6] * lz
            py = places[i, 10] + places[i, 1] * lx + places[i, 4] * ly + places[i, 7] * lz
            pz = places[i, 11] + places[i, 2] * lx + places[i, 5] * ly + places[i, 8] * lz
            ux, uy, uz = vx + wy * pz - wz * py, vy + wz * px - wx * pz, vz + wx * py - wy * px
            ax += mass * (d0 + d4 * pz - d5 * py + wy * uz - wz * uy)
            ay += mass * (d1 + d5 * px - d3 * pz + wz * ux - wx * uz)
            az += mass * (d2 + d3 * py - d4 * px + wx * uy - wy * ux)
            total += mass
    if total > 0.0:
        com_drift[0], com_drift[1], com_drift[2] = ax / total, ay / total, az / total
