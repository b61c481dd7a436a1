"""The controller's problem written down a second time, as the paper states it.

Variables are accelerations, contact forces and rotor torques (times the gear ratio); the
dissipative equation of motion with given directions is the equality, each direction's sign of mesh
power an inequality. Nothing of `wbc.control` assembles it.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import qpsolvers

from tests.control.scenes import (
    CERTAIN,
    arm,
    leg_controller,
    leg_references,
    leg_rows,
    random_state,
)
from wbc import control
from wbc.dynamics import dissipative_equation, evaluate
from wbc.effects import load_robot
from wbc.robot import Motion

REGULARISATION = 1e-6
FORCE_REGULARISATION = 1e-4
EXACT = control.ControllerSettings(speed_blend=CERTAIN, max_rounds=400, max_iterations=20000)


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


def cost_of(acceleration, rows, target):
    gap = rows @ acceleration - target
    return 0.5 * gap @ gap + 0.5e-6 * acceleration @ acceleration


def best_of_all(robot, q, v, task, contact_rows, **options):
    costs = {}
    for directions in product((-1.0, 1.0), repeat=robot.transmission.size):
        found = solve_in_directions(
            robot, q, v, np.array(directions), task, contact_rows, **options
        )
        if found is not None:
            costs[directions] = found[0]
    return costs


@pytest.mark.parametrize(("m", "states"), [(2, 300), (3, 200), (4, 100), (5, 30), (6, 12)])
def test_arm_finds_the_best_of_all_directions(m, states):
    """Random gears, states and tight torque limits; the enumeration knows nothing of the search."""
    solved = 0
    for seed in range(states):
        generator = np.random.default_rng(seed)
        robot = arm(m, generator)
        q, v = random_state(robot, generator, spread=2.0)
        wanted, weights = 30.0 * generator.normal(size=m), generator.uniform(0.1, 10.0, m)
        task = control.PostureTask.of(robot, weight=weights, stiffness=0.0, damping=0.0)
        controller = control.Controller(robot, [task], [], [control.RotorTorqueLimit()], EXACT)
        command = controller.step(Motion(q, v), {"posture": control.Reference(q, None, wanted)})
        rows = np.diag(np.sqrt(weights))
        target = np.sqrt(weights) * wanted
        costs = best_of_all(robot, q, v, (rows, target), [])
        if not costs:
            assert not command.status.usable
            continue
        assert command.status.usable, (seed, command.message)
        assert command.consistent
        offset = 0.5 * target @ target
        best = min(costs.values()) + offset
        reached = cost_of(command.acceleration, rows, target)
        assert reached <= best + 1e-5 * (1.0 + best), seed
        solved += 1
    assert solved > states // 2


@pytest.mark.parametrize("lossless", [False, True])
@pytest.mark.parametrize("name", ["planar_leg_strong", "parallelogram_leg"])
def test_leg_on_the_ground_finds_the_best_of_all_directions(name, lossless):
    """On perfect gears that is the classical equation of motion."""
    robot = load_robot(name).lossless() if lossless else load_robot(name)
    robot = robot.with_transmission(robot.transmission.replace(torque_limit=[1.2, 1.6]))
    weight = 19.0 * 9.81
    generator = np.random.default_rng(5)
    solved = 0
    for _ in range(80):
        q, v = random_state(robot, generator)
        com = generator.normal(size=2) * 0.3
        posture = generator.normal(size=2)
        command = leg_controller(robot, max_rounds=400, max_iterations=20000).step(
            Motion(q, v), leg_references(com, posture)
        )
        task = leg_rows(robot, evaluate(robot, q, v), com, posture)
        share = np.array([0.0, weight])
        costs = best_of_all(robot, q, v, task, [0, 2], force_share=share)
        if not costs:
            assert not command.status.usable
            continue
        assert command.status.usable, command.message
        force = command.forces["foot"][[0, 2]]
        offset = 0.5 * task[1] @ task[1]
        reached = cost_of(command.acceleration, *task)
        reached += 0.5 * force_cost(robot) * (force @ force - 2.0 * share @ force)
        best = min(costs.values()) + offset
        assert reached <= best + 1e-5 * (1.0 + best)
        solved += 1
    assert solved > 40


@pytest.mark.parametrize("policy", list(control.RestPolicy))
@pytest.mark.parametrize("speed", [0.0, 0.01, 0.5])
def test_torque_near_rest_stays_inside_the_stiction_interval(policy, speed):
    robot = load_robot("planar_leg_strong")
    gears = robot.transmission
    blend = control.SpeedBlend(full_speed=0.05, trusted_error=0.0, correction=0.0)
    controller = leg_controller(robot, rest_policy=policy, speed_blend=blend)
    q = robot.configuration(hip=-0.4, knee=0.8)
    v = np.zeros(5)
    v[3:] = speed
    command = controller.step(Motion(q, v))
    own = gears.reflected_inertia * command.acceleration[3:]
    mesh = gears.gear_ratio * command.rotor_torque - own
    ends = (
        np.array([gears.backward_efficiency, 1.0 / gears.forward_efficiency])
        * command.output_torque
    )
    assert np.all(mesh >= ends.min(axis=0) - 1e-9)
    assert np.all(mesh <= ends.max(axis=0) + 1e-9)
    if speed == 0.0:
        share = {
            control.RestPolicy.NEUTRAL: command.output_torque,
            control.RestPolicy.LEAST_TORQUE: ends[np.argmin(np.abs(ends), axis=0), [0, 1]],
            control.RestPolicy.MOST_MARGIN: ends.mean(axis=0),
        }[policy]
        np.testing.assert_allclose(mesh, share, rtol=1e-9)
    assert command.consistent
