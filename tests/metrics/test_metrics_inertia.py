"""Inertia tensors against accelerations that a force or a motor actually causes."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.dynamics import dissipative_equation, evaluate
from wbc.effects import load_robot
from wbc.errors import DynamicsError
from wbc.metrics import (
    backward_generalized_inertia,
    forward_generalized_inertia,
    generalized_inertia,
)

POSE = {"hip": -0.4, "knee": 0.9}


@pytest.mark.parametrize(("kind", "mode"), [("git", 0.0), ("backward", -1.0)])
@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg"])
def test_a_force_on_the_foot_moves_it_as_the_tensor_says(name: str, kind: str, mode: float) -> None:
    robot = load_robot(name)
    q = robot.configuration(**POSE)
    tensor = {"git": generalized_inertia, "backward": backward_generalized_inertia}[kind]
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    jacobian = terms.contact_jacobian[[0, 2]]
    equation = dissipative_equation(robot, terms, np.full(2, mode))
    for force in (np.array([3.0, 0.0]), np.array([-1.0, 2.0])):
        # Only what the force adds: gravity and the bias are taken out.
        torque = jacobian.T @ force + equation.bias
        moved = jacobian @ equation.acceleration(np.zeros(2), torque)
        np.testing.assert_allclose(tensor(robot, q, "foot", "xz") @ moved, force, atol=1e-9)


@pytest.mark.parametrize("topology", [[[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [-1.0, 1.0]]])
def test_motors_move_the_foot_as_the_forward_tensor_says(topology: list[list[float]]) -> None:
    robot = load_robot("planar_leg_fixed")
    robot = robot.with_transmission(robot.transmission.replace(topology=np.array(topology)))
    q = robot.configuration(**POSE)
    terms = evaluate(robot, q, np.zeros(2))
    jacobian = terms.contact_jacobian[[0, 2]]
    equation = dissipative_equation(robot, terms, np.ones(2))
    force = np.array([1.0, -2.0])
    rotor = np.linalg.solve(robot.transmission.distribution, jacobian.T @ force)
    moved = jacobian @ equation.acceleration(rotor, equation.bias)
    tensor = forward_generalized_inertia(robot, q, "foot", "xz")
    np.testing.assert_allclose(tensor @ moved, force, atol=1e-9)


def test_a_self_locking_gear_is_the_limit_of_a_vanishing_backward_efficiency() -> None:
    robot = load_robot("planar_leg")
    q = robot.configuration(**POSE)
    tensors = [
        backward_generalized_inertia(
            robot.with_transmission(
                robot.transmission.with_value("backward_efficiency", "knee", eta)
            ),
            q,
            "foot",
            "xz",
        )
        for eta in (1e-9, 0.0, -0.5)
    ]
    np.testing.assert_allclose(tensors[0], tensors[1], rtol=1e-6)
    np.testing.assert_array_equal(tensors[1], tensors[2])


@pytest.mark.parametrize(
    ("name", "axes", "message"),
    [
        ("planar_leg", "xyz", r"cannot be moved along \[-?0, -?1, -?0\]"),
        ("planar_leg", "xx", "at most once"),
        ("planar_leg", "", "at least one"),
        ("planar_leg", "xw", "There are: x, y, z"),
    ],
)
def test_axes_that_do_not_fit_are_named(name: str, axes: str, message: str) -> None:
    robot = load_robot(name)
    with pytest.raises(DynamicsError, match=message):
        generalized_inertia(robot, robot.configuration(**POSE), "foot", axes)


def test_a_singular_pose_is_named() -> None:
    robot = load_robot("planar_leg_fixed")
    with pytest.raises(DynamicsError, match="singular pose"):
        generalized_inertia(robot, np.zeros(2), "foot", "xz")


def test_the_forward_tensor_needs_a_gear_everywhere() -> None:
    robot = load_robot("planar_leg")
    with pytest.raises(DynamicsError, match="3 of 5 undriven"):
        forward_generalized_inertia(robot, robot.configuration(**POSE), "foot", "xz")
