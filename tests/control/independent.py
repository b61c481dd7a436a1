"""The controller's problem written down a second time, as the paper states it.

Variables are accelerations, contact forces and rotor torques (times the gear ratio); the
dissipative equation of motion with given directions is the equality, each direction's sign of mesh
power an inequality. Nothing of `wbc.control` assembles it.
"""

from __future__ import annotations

import numpy as np
import qpsolvers

from wbc.dynamics import dissipative_equation, evaluate

REGULARISATION = 1e-6
FORCE_REGULARISATION = 1e-4


def force_cost(robot):
    """Return the weight of 1/2 |f - share|^2 [1/N^2]."""
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    return FORCE_REGULARISATION / (0.1 * weight) ** 2


def solve_in_directions(
    robot,
    q,
    v,
    directions,
    task_rows,
    contact_rows,
    *,
    damping=10.0,
    friction=0.7,
    solver="daqp",
    force_share=None,
    guarded=True,
):
    """Return (cost, qdd, f, tau) for fixed directions (m,), or None where infeasible.

    task_rows: (weighted J, weighted target); contact_rows: rows of the stacked contact Jacobian.
    """
    gears = robot.transmission
    terms = evaluate(robot, q, v)
    equation = dissipative_equation(robot, terms, directions)
    nv, m, k = robot.model.nv, gears.size, len(contact_rows)
    J = terms.contact_jacobian[contact_rows]
    n = nv + k + m
    rows, target = task_rows
    H = np.zeros((n, n))
    H[:nv, :nv] = rows.T @ rows + REGULARISATION * np.eye(nv)
    g = np.zeros(n)
    g[:nv] = -rows.T @ target
    share = np.zeros(k) if force_share is None else force_share
    scale = force_cost(robot)
    H[nv : nv + k, nv : nv + k] = scale * np.eye(k)
    g[nv : nv + k] = -scale * share
    A = np.zeros((nv + k, n))
    b = np.zeros(nv + k)
    A[:nv, :nv] = equation.inertia
    A[:nv, nv : nv + k] = -J.T
    A[:nv, nv + k :] = -equation.actuation / gears.gear_ratio
    b[:nv] = -equation.bias
    A[nv:, :nv] = J
    b[nv:] = -terms.contact_drift[contact_rows] - damping * (J @ v)
    G, h = [], []
    for start in range(0, k, 2 if k % 3 else 3):
        cone = _cone(k, start, friction)
        G.extend(np.pad(row, (nv, m)) for row in cone)
        h.extend([0.0] * len(cone))
    for i in range(m):
        row = np.zeros(n)
        row[nv + k + i] = 1.0
        G.extend([row, -row])
        h.extend([abs(gears.gear_ratio[i]) * gears.torque_limit[i]] * 2)
    if guarded:
        psi = gears.motor_from_joint @ v[robot.actuated]
        for i in range(m):
            mesh = np.zeros(n)
            mesh[nv + k + i] = 1.0
            mesh[robot.actuated] -= gears.reflected_inertia[i] * gears.motor_from_joint[i]
            G.append(-directions[i] * np.sign(psi[i]) * mesh)
            h.append(0.0)
    problem = qpsolvers.Problem(H, g, np.array(G), np.array(h), A, b)
    try:
        found = qpsolvers.solve_problem(problem, solver=solver)
    except qpsolvers.SolverError:
        return None
    if not found.found or found.x is None:
        return None
    x = found.x
    if problem.G.shape[0] and (problem.G @ x - problem.h).max() > 1e-6:
        return None
    cost = 0.5 * x @ H @ x + g @ x
    return cost, x[:nv], x[nv : nv + k], x[nv + k :] / gears.gear_ratio


def _cone(k, start, friction):
    """Rows of the cone of one contact: exact in the plane, a four-sided inner pyramid in space."""
    if k % 3:
        sides = [(1.0, -friction), (-1.0, -friction), (0.0, -1.0)]
    else:
        slope = friction * np.cos(np.pi / 4)
        sides = [(1, 0, -slope), (-1, 0, -slope), (0, 1, -slope), (0, -1, -slope), (0, 0, -1)]
    rows = np.zeros((len(sides), k))
    for row, side in zip(rows, sides, strict=True):
        row[start : start + len(side)] = side
    return rows
