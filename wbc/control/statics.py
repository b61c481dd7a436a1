"""What holds a robot still, and how easily torques move it, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Dense,
    Flag,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutRow,
    OutVector,
    Places,
    Row,
    Vector,
    compiled,
)
from wbc.control.qp.linalg import factorise, substitute
from wbc.structures import Structure


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


STATICS = Structure(
    "Statics",
    links=Dense,
    reflected=Dense,
    bias=Row,
    effects=Row,
    jacobian=Dense,
    undriven=Places,
    driven=Places,
    share=Row,
    whole=OutDense,
    gravity=OutRow,
    pushed=OutRow,
)
"""What `place_statics` reads and writes.

Mass of links and reflected inertia (nv, nv), bias, torque of effects (nv,); contacts' jacobian,
undriven and driven coordinates, the load that each contact shares; memory (nv, nv), (nv,), (nv,).
"""


@compiled(Flag, STATICS.kind, Number, OutVector, OutDense, OutDense)
def place_statics(
    statics: Any, soft: float, hold: FloatArray, free: FloatArray, rested: FloatArray
) -> bool:
    """Write what `place_hold` and `place_mobilities` do.

    Args:
        statics: STATICS at rest.
        soft: as for `place_mobilities`.
        hold, free, rested: results.

    Returns:
        whether all systems were positive definite.
    """
    gravity, pushed, whole = statics.gravity, statics.pushed, statics.whole
    for i in range(len(gravity)):
        gravity[i] = statics.bias[i] - statics.effects[i]
        for j in range(len(gravity)):
            whole[i, j] = statics.links[i, j] + statics.reflected[i, j]
    undriven, driven, jacobian = statics.undriven, statics.driven, statics.jacobian
    place_pushed(jacobian, gravity, undriven, statics.share, soft, pushed)
    if not place_hold(whole, gravity, pushed, undriven, driven, hold):
        return False
    return place_mobilities(whole, jacobian, soft, driven, free, rested)


@compiled(Nothing, Dense, Dense, Vector, Number, Number, OutRow)
def place_braking(
    free: FloatArray,
    rested: FloatArray,
    speed: FloatArray,
    least: float,
    more: float,
    torque: FloatArray,
) -> None:
    """Write -(more C + least F)^-1 dpsi (m,); zero where a speed is unknown or nothing moves.

    Args:
        free, rested: F and C (m, m).
        speed: dpsi (m,).
        least, more: [s].
        torque: result.
    """
    m = len(torque)
    slowing = np.empty((m, m))
    moves = 0.0
    for i in range(m):
        torque[i] = -speed[i]
        for j in range(m):
            slowing[i, j] = more * rested[i, j] + least * free[i, j]
            moves = max(moves, abs(free[i, j]))
    known = moves > 0.0
    for i in range(m):
        known = known and np.isfinite(speed[i])
    if known and factorise(slowing, m):
        substitute(slowing, m, torque)
    else:
        torque[:] = 0.0


@compiled(Nothing, Vector, Vector, OutRow)
def place_clipped(torque: FloatArray, limit: FloatArray, clipped: FloatArray) -> None:
    """Write torques (m,) within +-limit (m,); what is not finite counts as zero."""
    for i in range(len(torque)):
        value = torque[i] if np.isfinite(torque[i]) else 0.0
        clipped[i] = min(max(value, -limit[i]), limit[i])
