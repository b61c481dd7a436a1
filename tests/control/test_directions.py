"""Directions of power: consistent always, the best of all 2^m, and between them at rest."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tests.control.independent import force_cost, solve_in_directions
from tests.control.scenes import (
    CERTAIN,
    arm,
    leg_controller,
    leg_references,
    leg_rows,
    random_state,
)
from wbc.control import (
    Controller,
    ControllerSettings,
    PostureTask,
    Reference,
    RestPolicy,
    RotorTorqueLimit,
    SpeedBlend,
)
from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.robot import Motion

EXACT = ControllerSettings(speed_blend=CERTAIN, max_rounds=400, max_iterations=20000)


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
        task = PostureTask.of(robot, weight=weights, stiffness=0.0, damping=0.0)
        controller = Controller(robot, [task], [], [RotorTorqueLimit()], EXACT)
        command = controller.step(Motion(q, v), {"posture": Reference(q, None, wanted)})
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


@pytest.mark.parametrize("policy", list(RestPolicy))
@pytest.mark.parametrize("speed", [0.0, 0.01, 0.5])
def test_torque_near_rest_stays_inside_the_stiction_interval(policy, speed):
    robot = load_robot("planar_leg_strong")
    gears = robot.transmission
    blend = SpeedBlend(full_speed=0.05, trusted_error=0.0, correction=0.0)
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
            RestPolicy.NEUTRAL: command.output_torque,
            RestPolicy.LEAST_TORQUE: ends[np.argmin(np.abs(ends), axis=0), [0, 1]],
            RestPolicy.MOST_MARGIN: ends.mean(axis=0),
        }[policy]
        np.testing.assert_allclose(mesh, share, rtol=1e-9)
    assert command.consistent
