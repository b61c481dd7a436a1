"""Rows of distances between points of two bodies, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Dense,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Places,
    Row,
    Table,
    compiled,
)


@compiled(
    Nothing,
    *(Table, Places, Places, Matrix, Dense, Dense, Dense, Row, *[Number] * 3),
    *(OutDense, OutRow),
)
def place_distance_rows(
    joints: IntArray,
    starts: IntArray,
    columns: IntArray,
    jacobian: FloatArray,
    rates: FloatArray,
    drifts: FloatArray,
    points: FloatArray,
    distances: FloatArray,
    margin: float,
    rate: float,
    influence: float,
    rows: FloatArray,
    least: FloatArray,
) -> None:
    """Write the rows of `CollisionLimit`, rows qdd >= least.

    Args:
        joints: joint of either side (p, 2).
        starts, columns: of every joint, the columns of J that move it.
        jacobian, rates, drifts: as `Kinematics` has them.
        points: nearest points of both sides and the direction between them (p, 9), world.
        distances: (p,) [m].
        margin, rate, influence: of the limit.
        rows, least: results (p, nv), (p,).
    """
    for i in range(len(distances)):
        for j in range(rows.shape[1]):
            rows[i, j] = 0.0
        least[i] = -1e20
        if not distances[i] < influence:
            continue
        nx, ny, nz = points[i, 6], points[i, 7], points[i, 8]
        speed, bend = 0.0, 0.0
        for side in range(2):
            sign = 2.0 * side - 1.0
            joint = joints[i, side]
            px, py, pz = points[i, 3 * side], points[i, 3 * side + 1], points[i, 3 * side + 2]
            mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
            for place in range(starts[joint], starts[joint + 1]):
                j = columns[place]
                along = nx * jacobian[0, j] + ny * jacobian[1, j] + nz * jacobian[2, j]
                along += mx * jacobian[3, j] + my * jacobian[4, j] + mz * jacobian[5, j]
                rows[i, j] += sign * along
            wx, wy, wz = rates[joint, 3], rates[joint, 4], rates[joint, 5]
            vx = rates[joint, 0] + wy * pz - wz * py
            vy = rates[joint, 1] + wz * px - wx * pz
            vz = rates[joint, 2] + wx * py - wy * px
            speed += sign * (nx * vx + ny * vy + nz * vz)
            ax, ay, az = drifts[joint, 3], drifts[joint, 4], drifts[joint, 5]
            bx = drifts[joint, 0] + ay * pz - az * py + wy * vz - wz * vy
            by = drifts[joint, 1] + az * px - ax * pz + wz * vx - wx * vz
            bz = drifts[joint, 2] + ax * py - ay * px + wx * vy - wy * vx
            bend += sign * (nx * bx + ny * by + nz * bz)
        least[i] = -bend - 2.0 * rate * speed - rate * rate * (distances[i] - margin)
