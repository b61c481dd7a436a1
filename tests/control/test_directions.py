"""Directions of power: consistent, the best of all 2^m, and between them at rest.

The controller's problem is written down a second time here, as the paper states it. Variables are
accelerations, contact forces and rotor torques (times the gear ratio); the dissipative equation of
motion with given directions is the equality, each direction's sign of mesh power an inequality.
Nothing of `wbc.control` assembles it.
"""

from itertools import product

import numpy as np
import pytest
import qpsolvers
from scipy.linalg import block_diag

from tests.control import scenes
from wbc import control, load_robot
from wbc.dynamics import dissipative_equation, evaluate
from wbc.robot import Motion

REGULARISATION = 1e-6
FORCE_REGULARISATION = 1e-4
EXACT = control.ControllerSettings(speed_blend=scenes.CERTAIN, max_iterations=20000)


def force_cost(robot):
    """Return the weight of 1/2 |f - share|^2 [1/N^2]."""
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    return FORCE_REGULARISATION / (0.1 * weight) ** 2


CONE = np.array([[1.0, -0.7], [-1.0, -0.7], [0.0, -1.0]])  # of a foot in the plane, mu = 0.7


def cost_in_directions(robot, q, v, directions, task, contact_rows, force_share):
    """Return the least cost for fixed directions (m,), or None where there is no motion.

    task: (weighted J, weighted target); contact_rows: rows of the stacked contact Jacobian.
    """
    gears, terms = robot.transmission, evaluate(robot, q, v)
    equation = dissipative_equation(robot, terms, directions)
    nv, m, k = robot.model.nv, gears.size, len(contact_rows)
    J, (rows, target), scale = terms.contact_jacobian[contact_rows], task, force_cost(robot)
    quadratic = rows.T @ rows + REGULARISATION * np.eye(nv)
    H = block_diag(quadratic, scale * np.eye(k), np.zeros((m, m)))
    g = np.concatenate([-rows.T @ target, -scale * force_share, np.zeros(m)])
    A = np.block([
        [equation.inertia, -J.T, -equation.actuation / gears.gear_ratio],
        [J, np.zeros((k, k + m))],
    ])  # fmt: skip
    drift = scenes.contact_drift(robot, q, v)
    b = np.concatenate([-equation.bias, -drift[contact_rows] - 10.0 * (J @ v)])
    torque, mesh = np.hstack([np.zeros((m, nv + k)), np.eye(m)]), np.zeros((m, nv))
    mesh[:, robot.actuated] = -gears.reflected_inertia[:, None] * gears.motor_from_joint
    power = directions * np.sign(gears.motor_from_joint @ v[robot.actuated])
    cone = np.hstack([np.zeros((3, nv)), CONE, np.zeros((3, m))]) if k else torque[:0]
    signs = -power[:, None] * np.hstack([mesh, np.zeros((m, k)), np.eye(m)])
    limit = np.abs(gears.gear_ratio) * gears.torque_limit
    G = np.vstack([cone, torque, -torque, signs])
    h = np.concatenate([np.zeros(len(cone)), limit, limit, np.zeros(m)])
    try:
        found = qpsolvers.solve_problem(qpsolvers.Problem(H, g, G, h, A, b), solver="daqp")
    except qpsolvers.SolverError:
        return None
    x = found.x
    if not found.found or x is None or (G @ x - h).max() > 1e-6:
        return None
    return 0.5 * x @ H @ x + g @ x


def cost_of(acceleration, rows, target):
    gap = rows @ acceleration - target
    return 0.5 * gap @ gap + 0.5e-6 * acceleration @ acceleration


def best_of_all(robot, q, v, task, contact_rows=(), force_share=()):
    """Return the least cost of all directions, or None where none has a motion."""
    every = product((-1.0, 1.0), repeat=robot.transmission.size)
    given = task, list(contact_rows), np.array(force_share)
    costs = [cost_in_directions(robot, q, v, np.array(directions), *given) for directions in every]
    return min((cost for cost in costs if cost is not None), default=None)


@pytest.mark.parametrize(("m", "states"), [(2, 150), (3, 100), (4, 60), (5, 25), (6, 10)])
def test_arm_finds_the_best_of_all_directions(m, states):
    """Random gears, states and tight torque limits; the enumeration knows nothing of the search."""
    solved = 0
    for seed in range(states):
        generator = np.random.default_rng(seed)
        robot = scenes.arm(m, generator)
        q, v = scenes.random_state(robot, generator, spread=2.0)
        wanted, weights = 30.0 * generator.normal(size=m), generator.uniform(0.1, 10.0, m)
        task = control.PostureTask.of(robot, weight=weights, stiffness=0.0, damping=0.0)
        controller = control.Controller(robot, [task], [], [control.RotorTorqueLimit()], EXACT)
        command = controller.step(Motion(q, v), {"posture": control.Reference(q, None, wanted)})
        rows = np.diag(np.sqrt(weights))
        target = np.sqrt(weights) * wanted
        best = best_of_all(robot, q, v, (rows, target))
        if best is None:
            assert not command.status.usable
            continue
        assert command.status.usable, (seed, command.message)
        assert command.consistent
        best += 0.5 * target @ target
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
    for _ in range(50):
        q, v = scenes.random_state(robot, generator)
        com = generator.normal(size=2) * 0.3
        posture = generator.normal(size=2)
        command = scenes.leg_controller(robot, max_iterations=20000).step(
            Motion(q, v), scenes.leg_references(com, posture)
        )
        task = scenes.leg_rows(robot, evaluate(robot, q, v), com, posture)
        share = np.array([0.0, weight])
        best = best_of_all(robot, q, v, task, [0, 2], share)
        if best is None:
            assert not command.status.usable
            continue
        assert command.status.usable, command.message
        force = command.forces["foot"][[0, 2]]
        reached = cost_of(command.acceleration, *task)
        reached += 0.5 * force_cost(robot) * (force @ force - 2.0 * share @ force)
        best += 0.5 * task[1] @ task[1]
        assert reached <= best + 1e-5 * (1.0 + best)
        solved += 1
    assert solved > 25


@pytest.mark.parametrize("policy", list(control.RestPolicy))
@pytest.mark.parametrize("speed", [0.0, 0.01, 0.5])
def test_torque_near_rest_stays_inside_the_stiction_interval(policy, speed):
    robot = load_robot("planar_leg_strong")
    gears = robot.transmission
    blend = control.SpeedBlend(full_speed=0.05, trusted_error=0.0, correction=0.0)
    controller = scenes.leg_controller(robot, rest_policy=policy, speed_blend=blend)
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
