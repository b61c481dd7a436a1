"""Inertia tensors, and the inertia by direction, against accelerations and the simulator."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.sim.random_robots import geared
from wbc import load_robot, metrics
from wbc.dynamics import dissipative_equation, evaluate
from wbc.sim import Plant

POSE = {"hip": -0.4, "knee": 0.9}


KINDS = [(metrics.generalized_inertia, 0.0), (metrics.backward_generalized_inertia, -1.0)]


@pytest.mark.parametrize(("kind", "mode"), KINDS)
@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg"])
def test_a_force_on_the_foot_moves_it_as_the_tensor_says(
    name: str, kind: Callable, mode: float
) -> None:
    robot = load_robot(name)
    q = robot.configuration(**POSE)
    tensor = kind(robot, q, "foot", "xz")
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    jacobian = terms.contact_jacobian[[0, 2]]
    equation = dissipative_equation(robot, terms, np.full(2, mode))
    for force in (np.array([3.0, 0.0]), np.array([-1.0, 2.0])):
        # Only what the force adds: gravity and the bias are taken out.
        torque = jacobian.T @ force + equation.bias
        moved = jacobian @ equation.acceleration(np.zeros(2), torque)
        np.testing.assert_allclose(tensor @ moved, force, atol=1e-9)


def test_a_self_locking_gear_is_the_limit_of_a_vanishing_backward_efficiency() -> None:
    robot = load_robot("planar_leg")
    q = robot.configuration(**POSE)
    eta_b = robot.transmission.backward_efficiency[0]
    legs = [geared(robot, backward_efficiency=[eta_b, knee]) for knee in (1e-9, 0.0, -0.5)]
    tensors = [metrics.backward_generalized_inertia(leg, q, "foot", "xz") for leg in legs]
    np.testing.assert_allclose(tensors[0], tensors[1], rtol=1e-6)
    np.testing.assert_array_equal(tensors[1], tensors[2])


def test_the_forward_tensor_holds_in_57_percent_of_the_directions_of_the_case_study() -> None:
    robot = load_robot("planar_leg_fixed")
    q = robot.pose("paper")
    found = metrics.directional_inertia(robot, q, "foot", "xz", 3600)
    assert found.share_forward == pytest.approx(0.57, abs=0.005)
    inverse = np.linalg.inv(metrics.forward_generalized_inertia(robot, q, "foot", "xz"))
    n = found.directions
    along = np.einsum("ki,ij,kj->k", n, inverse, n)
    np.testing.assert_allclose(found.forward_tensor * along, 1.0)
    exact = found.all_forward
    np.testing.assert_allclose(found.driven[exact], found.forward_tensor[exact])
    assert np.abs(found.driven / found.forward_tensor - 1.0)[~exact].max() > 0.2
    assert np.all(found.driven > found.lossless)


@pytest.mark.parametrize("name", ["planar_leg_fixed", "planar_leg", "parallelogram_leg"])
def test_the_simulator_starts_as_the_exact_inertia_says(name: str) -> None:
    """One short step from rest, without gravity: an independent solver of the same mesh law."""
    robot = geared(load_robot(name).with_gravity([0.0, 0.0, 0.0]), torque_limit=1e3)
    q = robot.pose("paper")
    directions = np.array([[np.cos(a), np.sin(a)] for a in np.deg2rad([10, 45, 70, 100, 160, 250])])
    found = metrics.directional_inertia(robot, q, "foot", "xz", directions)
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    jacobian = terms.contact_jacobian[[0, 2]]
    gears, plant, step = robot.transmission, Plant(replace(robot, contacts=())), 1e-5
    for n, mass in zip(directions, found.driven, strict=True):
        torque = gears.topology.T @ (jacobian.T @ n)[robot.actuated] / gears.gear_ratio
        state = plant.step(plant.state(q), torque, step).state
        moved = jacobian @ state.velocity / step
        assert 1.0 / (n @ moved) == pytest.approx(mass, rel=1e-5)


def test_self_locking_gears_still_drive_forward() -> None:
    robot = load_robot("planar_leg_fixed")
    locking = geared(robot, backward_efficiency=[-0.2, 0.0])
    found = metrics.directional_inertia(locking, robot.pose("paper"), "foot", "xz")
    exact = found.all_forward
    assert np.all(np.isfinite(found.driven[exact]))
    np.testing.assert_allclose(found.driven[exact], found.forward_tensor[exact])
    assert found.pushed.min() > 1e6  # nothing gives way


def test_a_driven_link_without_inertia_of_its_own_is_moved_by_its_rotor() -> None:
    """The wrist of a drawn arm: its links' mass matrix is singular, the arm's is not."""
    robot = load_robot("staubli_tx40")
    q = robot.configuration(joint_2=0.4, joint_3=1.2)
    links = evaluate(robot, q, np.zeros(robot.model.nv)).mass_matrix
    assert np.linalg.matrix_rank(links) < robot.model.nv
    robot = metrics.with_contact_at(robot, "link_6")
    found = metrics.directional_inertia(robot, q, "link_6", "xyz", 50)
    inverse = np.linalg.inv(metrics.generalized_inertia(robot, q, "link_6", "xyz"))
    along = np.einsum("ki,ij,kj->k", found.directions, inverse, found.directions)
    np.testing.assert_allclose(found.lossless * along, 1.0)
    np.testing.assert_allclose(found.driven, found.lossless, rtol=1e-6)  # its gears are perfect
    np.testing.assert_allclose(found.pushed, found.lossless, rtol=1e-6)
