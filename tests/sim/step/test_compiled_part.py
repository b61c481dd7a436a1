"""The compiled part of a step against the plain one, on random robots, states and steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.random_robots import BASES, random_robot
from wbc import load_robot
from wbc.effects import CoulombFriction, ViscousFriction
from wbc.robot import Robot
from wbc.sim import Plane, Plant
from wbc.sim.step import flow as flowing
from wbc.sim.tree.inertia import bias_at, bodies_at, inertia_at
from wbc.sim.tree.kinematics import columns_at, moved_along, place
from wbc.sim.tree.tree import tree_of


def _both(plant: Plant, state, torque, dt: float, external):
    """Return the part by loops and the plain one, None for the first where Newton fails."""
    setup = plant._setup
    kept = np.zeros(setup.barriers.size, dtype=bool)
    given = flowing.PartInput(setup, state, torque, dt, external, kept)
    return flowing._compiled(given, setup.inner), flowing._plain(given)


def _compare(fast, plain, scale: float) -> None:
    assert fast.state.position == pytest.approx(plain.state.position, abs=1e-8 * scale)
    assert fast.state.velocity == pytest.approx(plain.state.velocity, abs=1e-7 * scale)
    assert fast.gap == pytest.approx(plain.gap, abs=1e-8 * scale)
    assert np.array_equal(fast.state.closed, plain.state.closed)
    assert fast.state.motor_velocity == pytest.approx(plain.state.motor_velocity, abs=1e-7 * scale)
    assert fast.landed == plain.landed
    assert fast.energy.lost == pytest.approx(plain.energy.lost, abs=1e-7 * scale**2)
    assert fast.solution.residuals.worst_speed < 1e-8 * scale
    assert fast.solution.residuals.dynamics < 1e-8 * scale


def _random_case(seed: int) -> tuple[Robot, np.random.Generator]:
    rng = np.random.default_rng(seed)
    eta = rng.uniform(0.5, 1.0, 2)
    robot = random_robot(rng, BASES[seed % 3], eta[0], eta[1], rng.uniform(0.0, 1.2), False)
    if seed % 4 == 0:
        robot = robot.with_effects(
            ViscousFriction(robot.transmission.joints[0], 0.3),
            CoulombFriction(robot.transmission.joints[-1], 0.4),
        )
    return robot, rng


def test_the_tree_agrees_with_pinocchio() -> None:
    """Inertia, gravity and velocity terms, and motion along the joints."""
    chain = pin.Model()
    for kind in (pin.JointModelRUBX(), pin.JointModelPZ(), pin.JointModelFreeFlyer()):
        joint = chain.addJoint(chain.njoints - 1, kind, pin.SE3.Random(), f"j{chain.njoints}")
        chain.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Random())
    models = [_random_case(seed)[0].model for seed in range(6)]
    for model in (chain, load_robot("solo12").model, *models):
        _compare_tree(model, np.random.default_rng(1))


def _compare_tree(model: pin.Model, rng: np.random.Generator) -> None:
    tree, data = tree_of(model), model.createData()
    assert tree is not None
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    v, n, nv = rng.normal(size=model.nv), len(tree.joints), model.nv
    poses, columns, bodies, all_behind = (
        np.empty((a, b)) for a, b in ((n, 12), (nv, 6), (n, 10), (n, 10))
    )
    inertia, bias, moved, about = (
        np.empty((nv, nv)),
        np.empty(nv),
        np.empty(model.nq),
        rng.normal(size=3),
    )
    place(tree.joints, tree.shapes, q, poses)
    columns_at(tree.joints, tree.shapes, poses, about, columns)
    bodies_at(tree.joints, tree.shapes, poses, about, bodies, all_behind)
    inertia_at(tree.rows, all_behind, columns, nv, inertia)
    bias_at(tree.joints, tree.rows, tree.gravity, columns, bodies, v, bias)
    upper = np.triu(pin.crba(model, data, q))
    assert inertia == pytest.approx(upper + np.triu(upper, 1).T, rel=1e-12, abs=1e-12)
    assert bias == pytest.approx(pin.nonLinearEffects(model, data, q, v), rel=1e-11, abs=1e-11)
    for time in (1e-4, 0.3):
        moved_along(tree.joints, q, v, time, moved)
        assert moved == pytest.approx(pin.integrate(model, q, time * v), abs=1e-14)


def test_parts_of_random_robots_agree() -> None:
    agreed = touched = 0
    for seed in range(60):
        robot, rng = _random_case(seed)
        plant = Plant(robot, Plane.slope(0.2) if seed % 2 else Plane())
        q = pin.integrate(robot.model, robot.neutral(), rng.normal(size=robot.model.nv) * 0.4)
        state = plant.state(q, rng.normal(size=robot.model.nv), lifted=seed % 3 > 0)
        torque = rng.normal(size=robot.transmission.size) * 0.1
        closed = plant._setup.barriers.clearance(state.position, 0.0).gap < 1e-6
        state = state.replace(closed=closed)
        for step in range(4):
            external = rng.normal(size=robot.model.nv) if step % 2 else None
            fast, plain = _both(plant, state, torque, 1e-3, external)
            if fast is None:
                break
            rows = plain.solution.reduced.program.rows()
            if np.linalg.matrix_rank(rows) == len(rows):  # one split of forces
                _compare(fast, plain, 1.0 + np.abs(plain.state.velocity).max())
                agreed, touched = agreed + 1, touched + bool(plain.state.closed.any())
            state = fast.state
    assert agreed > 150
    assert touched > 15


def test_a_standing_robot_stays_in_the_loops() -> None:
    """Two of 120 steps left them: from the last step's branches Newton turned in a circle."""
    solo = load_robot("solo12")
    plant, pose, gears = Plant(solo), solo.pose(), solo.transmission
    state = plant.state(pose)
    for _ in range(140):
        angle = state.position[solo.actuated_position] - pose[solo.actuated_position]
        torque = -8.0 * (angle + 0.025 * state.velocity[solo.actuated]) / gears.gear_ratio
        result = plant.step(state, torque, 1e-3)
        state = result.state
        if len(result.parts) == 1 and not result.impacts:
            assert not isinstance(result.parts[0].end, flowing.PlainEnd)
