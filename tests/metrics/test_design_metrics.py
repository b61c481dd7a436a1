"""Many designs at once against the metrics of one robot, up to rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.errors import DynamicsError, TransmissionError
from wbc.metrics import (
    Designs,
    backdriving_force,
    contact_task,
    design_metrics,
    force_capability,
    forward_generalized_inertia,
    holding,
    impact_mitigation,
    sweep,
)
from wbc.metrics.contact_task import designs_task
from wbc.robot import Robot

ROUNDING = {"rtol": 1e-9, "atol": 1e-12}


def varied(robot: Robot, k: int, seed: int = 1) -> Designs:
    """Return designs in which everything varies, some of the gears self-locking."""
    rng, m = np.random.default_rng(seed), robot.transmission.size
    q = np.tile(robot.pose(), (k, 1))
    driven = robot.actuated_position
    q[:, driven] += 0.2 * rng.normal(size=(k, m))
    gears = {
        "gear_ratio": rng.uniform(6, 160, k) * rng.choice([-1, 1], k),
        "rotor_inertia": rng.uniform(1e-6, 1e-4, (k, m)),
        "forward_efficiency": rng.uniform(0.4, 0.98, (k, m)),
        "backward_efficiency": rng.uniform(-0.1, 0.98, (k, m)),
        "rotor_coulomb_friction": rng.uniform(0.0, 0.1, (k, m)),
        "torque_limit": rng.uniform(0.5, 3.0, (k, m)),
    }
    last = robot.bodies[-2:]
    lengths = {body: rng.uniform(0.1, 0.6, k) for body in last}
    masses = {body: rng.uniform(0.5, 3.0, k) for body in last}
    return Designs.of(robot, q, gears, lengths, masses)


@pytest.mark.parametrize(
    ("name", "contact", "axes"),
    [
        ("planar_leg", "foot", "xz"),
        ("planar_leg_fixed", "foot", "xz"),
        ("parallelogram_leg", "foot", "xz"),
        ("solo12", "HR_foot", "xyz"),
    ],
)
@pytest.mark.parametrize("coupled", [False, True])
def test_many_designs_are_the_metrics_of_each(
    name: str, contact: str, axes: str, coupled: bool
) -> None:
    robot = replace(load_robot(name), rotors_turn_with_links=coupled)
    designs = varied(robot, 40)
    n = np.arange(1.0, 1.0 + len(axes))
    found = design_metrics(designs, contact, n, axes, load=30.0)
    for i in range(designs.size):
        one, q = designs.robot_at(i)
        task = contact_task(one, q, contact, axes)
        unit = task.direction(n)
        free, driven = (unit @ task.mobility(mode)[0] @ unit for mode in (0.0, -1.0))
        held_still = driven <= 1e-12 * free
        force = force_capability(one, q, contact, axes).along(n)
        expected = {
            "inertia": 1.0 / free,
            "backward_inertia": np.inf if held_still else 1.0 / driven,
            "conventional": force.conventional,
            "lift": force.lift,
            "hold": force.hold,
            "impact_mitigation": (
                np.nan if held_still else impact_mitigation(one, q, contact, axes).along(n)
            ),
            "backdriving_force": backdriving_force(one, q, contact, n, axes),
        }
        held = holding(one, q, contact, n, 30.0, axes)
        expected["holding_torque"] = np.linalg.norm(held.least)
        expected["holding_torque_lossless"] = np.linalg.norm(held.lossless)
        expected["heat_saved"] = held.heat_saved
        if not held_still and not one.transmission.self_locking.any():
            factor = impact_mitigation(one, q, contact, axes)
            expected["impact_mitigation_determinant"] = factor.determinant
        perfect = impact_mitigation(one, q, contact, axes, 0.0)
        expected["impact_mitigation_lossless"] = perfect.along(n)
        if not robot.floating_size:
            tensor = forward_generalized_inertia(one, q, contact, axes)
            expected["forward_inertia"] = 1.0 / (unit @ np.linalg.inv(tensor) @ unit)
        for metric, value in expected.items():
            np.testing.assert_allclose(
                getattr(found, metric)[i], np.squeeze(value), err_msg=metric, **ROUNDING
            )
    assert designs.gears["backward_efficiency"].min() < 0.0


@pytest.mark.parametrize("name", ["planar_leg", "solo12"])
def test_the_links_are_those_of_pinocchio(name: str) -> None:
    robot = load_robot(name)
    rng = np.random.default_rng(3)
    q = robot.pose()
    q[robot.actuated_position] += rng.normal(size=robot.transmission.size)
    designs = Designs.of(robot, q, masses={robot.bodies[-1]: [0.2, 0.9]})
    terms = designs_task(designs, robot.contacts[0].name)
    for i in range(2):
        one, pose = designs.robot_at(i)
        reference = evaluate(one, pose, np.zeros(one.model.nv))
        pick = min(i, len(terms.mass_matrix) - 1)
        np.testing.assert_allclose(terms.mass_matrix[pick], reference.mass_matrix, **ROUNDING)
        np.testing.assert_allclose(terms.jacobian[0], reference.contact_jacobian[:3], **ROUNDING)


def test_a_stretched_leg_carries_as_statics_say() -> None:
    robot = load_robot("planar_leg")
    lengths = np.array([0.2, 0.4, 0.8])
    designs = Designs.of(robot, robot.pose("paper"), lengths={"thigh": lengths, "shin": lengths})
    found = design_metrics(designs, "foot", [0, 1], "xz")
    np.testing.assert_allclose(found.conventional, 20.0 / (lengths * np.sin(np.pi / 6)))
    reach = force_capability(*designs.robot_at(2), "foot", "xz")
    assert reach.along([0, 1]).conventional == pytest.approx(50.0)


def test_what_cannot_be_is_named() -> None:
    robot = load_robot("planar_leg")
    q = robot.pose("paper")
    for given, message in (
        ({"gears": {"ratio": [6.0]}}, "gear_ratio"),
        ({"gears": {"gear_ratio": [6.0, 0.0]}}, "design 1"),
        ({"gears": {"forward_efficiency": [0.9], "backward_efficiency": [1.2]}}, "create power"),
        ({"gears": {"gear_ratio": [6.0, 7.0], "torque_limit": [1.0, 2.0, 3.0]}}, "2, 3 designs"),
        ({"gears": {"gear_ratio": [[1.0, 2.0, 3.0]]}}, "shape"),
        ({"lengths": {"slide_x": [1.0]}}, "no length"),
        ({"masses": {"slide_x": [1.0]}}, "must be > 0"),
        ({"masses": {"thigh": [-1.0]}}, "must be > 0"),
    ):
        with pytest.raises((DynamicsError, TransmissionError), match=message):
            Designs.of(robot, q, **given)  # type: ignore[arg-type]


def test_a_straighter_leg_carries_more() -> None:
    robot = load_robot("planar_leg")
    knees = np.array([1.6, 1.2, 0.8, 0.4])
    poses = np.array([robot.configuration(hip=-k / 2, knee=k) for k in knees])
    table = sweep(robot, poses, "foot", [0, 1], axes="xz")
    # Statics of two equal links with the foot under the hip: the knee's lever is L sin(knee/2).
    np.testing.assert_allclose(table.conventional, 20.0 / (0.4 * np.sin(knees / 2)))
    with pytest.raises(DynamicsError, match="singular"):
        sweep(robot, np.zeros((1, 5)), "foot", [0, 1], axes="xz")


def test_self_locking_gears_on_a_fixed_base_are_infinitely_heavy() -> None:
    robot = load_robot("planar_leg_fixed")
    table = sweep(
        robot, robot.pose("paper"), "foot", [0, 1], {"forward_efficiency": [0.45, 0.6]}, axes="xz"
    )
    assert table.backward_inertia[0] == np.inf
    assert np.isnan(table.impact_mitigation[0])
    assert table.hold[0] == np.inf
    assert np.isfinite(table.inertia).all()
    assert table.backward_inertia[1] > table.inertia[1]
    # On a floating base the leg is a rigid body then, which mitigates nothing.
    floating = load_robot("planar_leg")
    rigid = sweep(
        floating, floating.pose("paper"), "foot", [0, 1], {"forward_efficiency": [0.45]}, axes="xz"
    )
    assert np.isfinite(rigid.backward_inertia[0])
    assert rigid.impact_mitigation[0] == pytest.approx(0.0, abs=1e-9)
    # One locked gear leaves the other one to give.
    gears = robot.transmission.replace(backward_efficiency=np.array([-0.2, 0.5]))
    partly = sweep(
        robot.with_transmission(gears), robot.pose("paper")[None], "foot", [0, 1], axes="xz"
    )
    assert np.isfinite(partly.backward_inertia[0])
    assert partly.backward_inertia[0] > table.inertia[0]
