"""Compiled trees of bodies and small matrices against pinocchio and NumPy."""

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.random_robots import BASES, random_robot
from wbc import load_robot
from wbc.mechanics.inertia import bodies_at, composites_of, inertia_at, move_bodies
from wbc.mechanics.kinematics import columns_at, moved_along, place, tree_of
from wbc.mechanics.linear import factor, solve_factored


def test_the_tree_agrees_with_pinocchio() -> None:
    """Inertia, gravity and velocity terms, and motion along the joints."""
    chain = pin.Model()
    for kind in (pin.JointModelRUBX(), pin.JointModelPZ(), pin.JointModelFreeFlyer()):
        joint = chain.addJoint(chain.njoints - 1, kind, pin.SE3.Random(), f"j{chain.njoints}")
        chain.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Random())
    drawn = [np.random.default_rng(seed) for seed in range(6)]
    robots = [random_robot(rng, BASES[k % 3], 0.8, 0.8, 0.5, False) for k, rng in enumerate(drawn)]
    for model in (chain, load_robot("solo12").model, *(robot.model for robot in robots)):
        _compare_tree(model, np.random.default_rng(1))


def _compare_tree(model: pin.Model, rng: np.random.Generator) -> None:
    tree, data = tree_of(model), model.createData()
    assert tree is not None
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    v, n, nv = rng.normal(size=model.nv), len(tree.joints), model.nv
    sizes = (n, 12), (nv, 6), (n, 10), (n, 10), (nv, nv), nv, model.nq
    poses, columns, bodies, all_behind, inertia, bias, moved = map(np.empty, sizes)
    about = rng.normal(size=3)
    place(tree.joints, tree.shapes, q, poses)
    columns_at(tree.joints, tree.shapes, poses, about, columns)
    bodies_at(tree.joints, tree.shapes, poses, about, bodies)
    composites_of(tree.joints, bodies, all_behind)
    inertia_at(tree.rows, all_behind, columns, inertia)
    motion, drift, force = np.empty((3, n, 6))
    moving = motion, drift, force
    move_bodies(tree.joints, tree.gravity, columns, bodies, v, *moving, bias)
    upper = np.triu(pin.crba(model, data, q))
    assert inertia == pytest.approx(upper + np.triu(upper, 1).T, rel=1e-12, abs=1e-12)
    assert bias == pytest.approx(pin.nonLinearEffects(model, data, q, v), rel=1e-11, abs=1e-11)
    for time in (1e-4, 0.3):
        moved_along(tree.joints, q, v, time, moved)
        assert moved == pytest.approx(pin.integrate(model, q, time * v), abs=1e-14)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 8, 11, 32, 67])
def test_factors_solve_a_system(size: int) -> None:
    rng = np.random.default_rng(size)
    matrix, right = rng.normal(size=(size, size)), rng.normal(size=size)
    matrix[0, 0] = 0.0 if size > 1 else 1.0  # the first pivot must be looked for
    factors, pivots, found = matrix.copy(), np.zeros(size, dtype=np.int64), right.copy()
    assert factor(factors, pivots)
    solve_factored(factors, pivots, found)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("size", [1, 4, 6, 9])
def test_a_singular_matrix_is_told(size: int) -> None:
    matrix = np.ones((size, size)) if size > 1 else np.zeros((1, 1))
    assert not factor(matrix, np.zeros(size, dtype=np.int64))
