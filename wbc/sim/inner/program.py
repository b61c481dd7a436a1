"""The program of a part in its rows, w = free + (G H^-1 G') impulse, and its solution by Newton."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutRow,
    Row,
    compiled,
)
from wbc.sim.solve.in_velocities import fewer_products
from wbc.sim.solve.linear import factor_inertia, halfway, products, rest_of_way
from wbc.sim.solve.newton import newton_loop

RATIO, INERTIA, VISCOUS, COULOMB, INVERSE, BACKWARD = range(6)
"""Columns of a table of gears: N, N^2 I_r, N^2 and |N| times the friction, 1/eta_f, eta_b."""


@compiled(Nothing, Dense, Dense, Row, Row, Row, Number, OutDense, counted=False)
def gear_laws(
    gears: FloatArray,
    gear_rows: FloatArray,
    v: FloatArray,
    torque: FloatArray,
    dry: FloatArray,
    step: float,
    laws: FloatArray,
) -> None:
    """Write the law (m, 9) of every gear over a step: what its rotor brings along, and its losses.

    Args:
        gears: (m, 6), columns RATIO to BACKWARD.
        gear_rows: (m, nv) speed of the motor outputs per v.
        v: (nv,) before the step.
        torque: (m,) on the rotors.
        dry: (m,) level of dry friction at the joints.
        step: h [s].
        laws: to write, see `element_piece`.
    """
    for i in range(len(gears)):
        gear, law, speed = gears[i], laws[i], 0.0
        for j in range(len(v)):
            speed += gear_rows[i, j] * v[j]
        brought = step * gear[RATIO] * torque[i] + gear[INERTIA] * speed
        law[0], law[1] = brought - step * gear[COULOMB], brought + step * gear[COULOMB]
        law[2], law[3] = gear[INERTIA] + step * gear[VISCOUS], gear[INVERSE]
        law[4], law[5], law[6] = gear[BACKWARD], step * dry[i], 0.0
        law[7], law[8] = np.inf, 0.0


@compiled(Nothing, Dense, Count, OutRow, OutRow, counted=False)
def lines(delassus: FloatArray, pairs: int, spring: FloatArray, slope: FloatArray) -> None:
    """Write the springs that hold a split left open, and the slopes on which rows meet their laws.

    Args:
        delassus: (r, r).
        pairs: number of rows at the end that are pairs of tangents, which share a slope.
        spring: (r,) to write.
        slope: (r,) to write.
    """
    size, most = len(delassus), 0.0
    for i in range(size):
        most = max(most, delassus[i, i])
    floor = max(1e-9 * most, 1e-21)
    for i in range(size):
        own = max(delassus[i, i], floor)
        spring[i], slope[i] = 1e-9 * own, 1.0 / own
    for i in range(size - pairs, size, 2):
        both = 1.0 / (1.0 / slope[i] + 1.0 / slope[i + 1])
        slope[i] = slope[i + 1] = both


@compiled(
    Count, Dense, Dense, Dense, Row, Row, Count, Row, Row, Number,
    OutRow, OutRow, OutRow,
)  # fmt: skip
def solve_rows(
    matrix: FloatArray,
    lower: FloatArray,
    laws: FloatArray,
    targets: FloatArray,
    frictions: FloatArray,
    tangents: int,
    free: FloatArray,
    start: FloatArray,
    accuracy: float,
    impulse: FloatArray,
    speed: FloatArray,
    after: FloatArray,
) -> int:
    """Write row impulses and speeds (r,) with every row on its law, and v (nv,) after.

    Args:
        matrix: G (r, nv).
        lower: L (nv, nv) with L' L = H_l.
        laws: (m, 9).
        targets: (l + k,).
        frictions: (k,).
        tangents: d.
        free: v (nv,) without the rows.
        start: (r,).
        accuracy: accepted distance of a row from its law, as a share of the largest speed plus 1.
        impulse, speed, after: to write.

    Returns:
        the number of linear systems solved, -1 where Newton does not converge.
    """
    size, n = matrix.shape
    half, delassus = np.empty((n, size)), np.empty((size, size))
    own, spring, slope = np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        for j in range(n):
            half[j, i] = matrix[i, j]
    halfway(lower, half)
    products(half, delassus)
    fastest = 0.0
    for i in range(size):
        total = 0.0
        for j in range(n):
            total += matrix[i, j] * free[j]
        own[i] = total
        fastest = max(fastest, abs(total))
    for i in range(len(targets)):
        fastest = max(fastest, targets[i])  # below zero: see TOLERANCE
    lines(delassus, len(frictions) * 2 if tangents == 2 else 0, spring, slope)
    limit = 0 if size > n else 12
    tolerance = accuracy * (1.0 + fastest)
    used = 0
    if size > 0:
        ways = np.ascontiguousarray(half.T) if fewer_products(size, n) else np.empty((0, 0))
        used = newton_loop(
            ways, delassus, own, spring, slope, laws, targets, frictions, tangents, start,
            tolerance, limit, impulse,
        )  # fmt: skip
        if used < 0:  # The last step's branches lead astray: start from none.
            used = newton_loop(
                ways, delassus, own, spring, slope, laws, targets, frictions, tangents,
                np.zeros(size), tolerance, limit, impulse,
            )  # fmt: skip
        if used < 0:
            return -1
    for j in range(n):
        total = 0.0
        for i in range(size):
            total += half[j, i] * impulse[i]
        after[j] = total
    rest_of_way(lower, after)
    good = 0.0
    for j in range(n):
        after[j] += free[j]
        good += after[j]
    for i in range(size):
        total = own[i]
        for j in range(size):
            total += delassus[i, j] * impulse[j]
        speed[i] = total
    return used if np.isfinite(good) else -1


@compiled(Flag, Dense, Row, Row, Number, OutRow, OutDense, counted=False)
def free_velocity(
    inertia: FloatArray,
    v: FloatArray,
    force: FloatArray,
    step: float,
    free: FloatArray,
    lower: FloatArray,
) -> bool:
    """Write v + h H_l^-1 force (nv,) and the factor of H_l; False where H_l is not positive."""
    if not factor_inertia(inertia, lower):
        return False
    for i in range(len(v)):
        free[i] = step * force[i]
    halfway(lower, free.reshape(-1, 1))
    rest_of_way(lower, free)
    for i in range(len(v)):
        free[i] += v[i]
    return True
