"""The step as a quadratic program with piecewise quadratic costs: the certified way.

Each monotone law is a convex, piecewise quadratic cost psi(w) whose pieces become slack speeds:
w = sum of the pieces' lengths, each with a linear and a quadratic cost that grow from one piece to
the next, so that the minimum fills them in order. Contacts with friction along one tangent are
linear complementarity; Coulomb's law is reached from the associated problem (which lifts off while
it slides) by De Saxce's correction, the normal target lowered by mu |u_t| until it repeats.
"""

from __future__ import annotations

import numpy as np
from proxsuite import proxqp

from wbc.arrays import FloatArray
from wbc.sim.elements import Elements
from wbc.sim.reduced import Reduced

_OUTER = 200


def solve_qp(reduced: Reduced, start: FloatArray) -> FloatArray | None:
    """Return row impulses (r,), or None where the program is no quadratic program.

    That is so with two tangents per contact (a second-order cone) and with self-locking gears.
    """
    elements = reduced.program.elements
    if reduced.tangents == 2 or (elements.size and elements.backward.min() <= 0.0):
        return None
    pieces = [_pieces(elements, i) for i in range(elements.size)]
    impulse = start
    slip = np.zeros(reduced.contacts)
    for _ in range(_OUTER if reduced.tangents and reduced.contacts else 1):
        found = _solve(reduced, pieces, slip)
        if found is None:
            return None
        impulse = found
        speeds = reduced.speeds(impulse)[reduced.tangent_rows]
        following = np.abs(speeds) if reduced.tangents else slip
        if np.abs(following - slip).max(initial=0.0) < 1e-10:
            break
        slip = following
    return impulse


def _pieces(elements: Elements, i: int) -> list[tuple[float, float, float, float]]:
    """Return (direction, length, slope at its start, curvature) of the pieces of psi_i."""
    up, down, inertia = elements.up[i], elements.down[i], elements.inertia[i]
    forward, backward = 1.0 / elements.forward[i], elements.backward[i]
    friction, damping = elements.friction[i], elements.damping[i]
    result = []
    for sign, bring in ((1.0, up), (-1.0, -down)):
        # Along this direction everything is as for turning forward with `bring`.
        if bring > 0.0:
            length = bring / inertia if inertia > 0.0 else np.inf
            gains = [(length, bring, forward)]
            if np.isfinite(length):
                gains.append((np.inf, 0.0, backward))
        else:
            gains = [(np.inf, bring, backward)]
        passed = 0.0
        for length, rest, gain in gains:
            level = -rest / gain + friction + damping * passed
            result.append((sign, length, level, inertia / gain + damping))
            passed += length
    return result


def _solve(
    reduced: Reduced, pieces: list[list[tuple[float, float, float, float]]], slip: FloatArray
) -> FloatArray | None:
    """Solve the convex program with normal targets lowered by mu `slip`."""
    program = reduced.program
    n, m, u = len(program.free_velocity), reduced.elements, program.unilateral
    flat = [(i, *piece) for i, row in enumerate(pieces) for piece in row]
    size = n + len(flat) + m
    cost = np.zeros((size, size))
    cost[:n, :n] = program.inertia
    linear = np.zeros(size)
    linear[:n] = -program.inertia @ program.free_velocity
    equal = np.zeros((m, size))
    equal[:, :n] = program.elements.rows
    for i in range(m):
        equal[i, n + len(flat) + i] = -1.0
    # The last m unknowns are the element speeds beside their spring, w - W v.
    low, high = np.full(len(flat), 0.0), np.zeros(len(flat))
    for j, (i, sign, length, level, curvature) in enumerate(flat):
        cost[n + j, n + j] = curvature
        linear[n + j] = level
        equal[i, n + j] = -sign
        high[j] = length
    spring = program.elements.compliance
    for i in range(m):
        j = n + len(flat) + i
        equal[i, j] = 1.0 if spring[i] > 0.0 else 0.0
        cost[j, j] = 1.0 / spring[i] if spring[i] > 0.0 else 1.0
    right = -program.elements.offset
    bounds = np.zeros((len(flat), size))
    bounds[:, n : n + len(flat)] = np.eye(len(flat))
    push = np.zeros((reduced.limits + reduced.contacts * (1 + reduced.tangents), size))
    floor = np.zeros(len(push))
    nl, k = reduced.limits, reduced.contacts
    push[:nl, :n], floor[:nl] = u.limits, u.target[:nl]
    wanted = u.target[nl:] - u.friction * slip
    if reduced.tangents:
        push[nl : nl + k, :n] = u.normals + u.friction[:, None] * u.tangents
        push[nl + k :, :n] = u.normals - u.friction[:, None] * u.tangents
        floor[nl:] = np.concatenate((wanted, wanted))
    else:
        push[nl:, :n], floor[nl:] = u.normals, wanted
    inequality = np.vstack((bounds, push))
    lower = np.concatenate((low, floor))
    upper = np.concatenate((high, np.full(len(push), np.inf)))
    lower[: len(flat)] = 0.0
    dual = _run(cost, linear, equal, right, inequality, np.minimum(lower, upper), upper)
    if dual is None:
        return None
    equal_dual, push_dual = dual[:m], dual[m + len(flat) :]
    return _impulses(reduced, equal_dual, push_dual)


def _impulses(reduced: Reduced, equal_dual: FloatArray, push_dual: FloatArray) -> FloatArray:
    """Return row impulses from proxsuite's multipliers (negative where a lower bound acts)."""
    m, nl, k = reduced.elements, reduced.limits, reduced.contacts
    impulse = np.zeros(len(reduced.free))
    impulse[:m] = -equal_dual
    impulse[m : m + nl] = -push_dual[:nl]
    if reduced.tangents:
        one, other = -push_dual[nl : nl + k], -push_dual[nl + k :]
        impulse[m + nl : m + nl + k] = one + other
        impulse[m + nl + k :] = reduced.program.unilateral.friction * (one - other)
    else:
        impulse[m + nl : m + nl + k] = -push_dual[nl:]
    return impulse


def _run(
    cost: FloatArray,
    linear: FloatArray,
    equal: FloatArray,
    right: FloatArray,
    inequality: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray | None:
    """Return the multipliers of equalities and inequalities, None where proxsuite fails."""
    solver = proxqp.dense.QP(len(linear), len(equal), len(inequality))
    solver.settings.eps_abs = 1e-11
    solver.settings.eps_rel = 0.0
    solver.settings.max_iter = 2000
    solver.init(cost, linear, equal, right, inequality, lower, np.minimum(upper, 1e20))
    solver.solve()
    if solver.results.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
        return None
    return np.concatenate((solver.results.y, solver.results.z))
