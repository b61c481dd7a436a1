"""What holds a robot still, and how easily torques move it, compiled."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Flag,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutVector,
    Places,
    Vector,
    compiled,
)
from wbc.control.solvers.positive_definite import factorise, substitute


@compiled(Nothing, Matrix, Vector, Places, Vector, Number, OutVector)
def place_pushed(
    jacobian: FloatArray,
    gravity: FloatArray,
    undriven: IntArray,
    share: FloatArray,
    soft: float,
    pushed: FloatArray,
) -> None:
    """Write J' f (nv,) of forces that carry gravity's undriven rows, nearest to `share` (k,).

    Args:
        jacobian: J (k, nv) of the contacts.
        gravity: (nv,) [N m, N] that holds the robot where it is.
        undriven: coordinates (u,).
        share: forces (k,) [N] that carry the weight in equal parts.
        soft: added to the system's diagonal, for contacts that cannot carry every row.
        pushed: result.
    """
    k, u = len(share), len(undriven)
    normal, missing = np.empty((u, u)), np.empty(u)
    for i in range(u):
        missing[i] = gravity[undriven[i]]
        for row in range(k):
            missing[i] -= jacobian[row, undriven[i]] * share[row]
        for j in range(i + 1):
            normal[i, j] = soft if i == j else 0.0
            for row in range(k):
                normal[i, j] += jacobian[row, undriven[i]] * jacobian[row, undriven[j]]
    if factorise(normal, u):
        substitute(normal, u, missing)
    else:
        missing[:] = 0.0
    pushed[:] = 0.0
    for row in range(k):
        force = share[row]
        for i in range(u):
            force += jacobian[row, undriven[i]] * missing[i]
        for j in range(len(pushed)):
            pushed[j] += jacobian[row, j] * force


@compiled(Flag, Matrix, *[Vector] * 2, Places, Places, OutVector)
def place_hold(
    mass: FloatArray,
    gravity: FloatArray,
    pushed: FloatArray,
    undriven: IntArray,
    driven: IntArray,
    hold: FloatArray,
) -> bool:
    """Write M_mu a + g_m - p_m with a = M_uu^-1 (p_u - g_u) (m,); return whether M_uu > 0.

    Args:
        mass: M (nv, nv).
        gravity, pushed: g and p (nv,).
        undriven, driven: coordinates u and m.
        hold: result.
    """
    u = len(undriven)
    block, base = np.empty((u, u)), np.empty(u)
    for i in range(u):
        base[i] = pushed[undriven[i]] - gravity[undriven[i]]
        for j in range(i + 1):
            block[i, j] = mass[undriven[i], undriven[j]]
    if not factorise(block, u):
        return False
    substitute(block, u, base)
    for i in range(len(driven)):
        row = driven[i]
        hold[i] = gravity[row] - pushed[row]
        for j in range(u):
            hold[i] += mass[row, undriven[j]] * base[j]
    return True


@compiled(Flag, Matrix, Matrix, Number, Places, OutDense, OutDense)
def place_mobilities(
    mass: FloatArray,
    jacobian: FloatArray,
    soft: float,
    driven: IntArray,
    free: FloatArray,
    rested: FloatArray,
) -> bool:
    """Write the accelerations of driven coordinates per torque on them (m, m).

    With L L' = M, S = L^-1 of the driven columns and C = L^-1 J', they are S'S without contacts,
    and S'S - S'C (C'C + e 1)^-1 C'S while the contacts rest.

    Args:
        mass: M (nv, nv), positive definite.
        jacobian: J (k, nv) of the contacts.
        soft: e, as a share of one plus the trace of C'C.
        driven: coordinates (m,).
        free, rested: results without contacts and with them.

    Returns:
        whether both systems were positive definite.
    """
    nv, m, k = len(mass), len(driven), len(jacobian)
    factor, reach = np.empty((nv, nv)), np.zeros((m + k, nv))
    for i in range(nv):
        for j in range(i + 1):
            factor[i, j] = mass[i, j]
    if not factorise(factor, nv):
        return False
    for row in range(m + k):
        if row < m:
            reach[row, driven[row]] = 1.0
        else:
            for j in range(nv):
                reach[row, j] = jacobian[row - m, j]
        for i in range(nv):
            left = reach[row, i]
            for j in range(i):
                left -= factor[i, j] * reach[row, j]
            reach[row, i] = left * factor[i, i]
    normal, across, trace = np.empty((k, k)), np.empty((m, k)), 0.0
    for i in range(k):
        for j in range(i + 1):
            normal[i, j] = 0.0
            for c in range(nv):
                normal[i, j] += reach[m + i, c] * reach[m + j, c]
        trace += normal[i, i]
    for i in range(k):
        normal[i, i] += soft * (1.0 + trace)
    if not factorise(normal, k):
        return False
    for i in range(m):
        for j in range(k):
            left = 0.0
            for c in range(nv):
                left += reach[i, c] * reach[m + j, c]
            for c in range(j):
                left -= normal[j, c] * across[i, c]
            across[i, j] = left * normal[j, j]
        for j in range(i + 1):
            whole, taken = 0.0, 0.0
            for c in range(nv):
                whole += reach[i, c] * reach[j, c]
            for c in range(k):
                taken += across[i, c] * across[j, c]
            free[i, j], free[j, i] = whole, whole
            rested[i, j], rested[j, i] = whole - taken, whole - taken
    return True
