from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import DynamicsError, TransmissionError
from wbc.metrics import (
    backward_generalized_inertia,
    efficiency_sweep,
    gear_ratio_sweep,
    impact_mitigation,
    pose_sweep,
)

POSE = {"hip": -np.pi / 6, "knee": np.pi / 3}


def test_lower_efficiency_holds_more_and_mitigates_less() -> None:
    robot = load_robot("planar_leg")
    table = efficiency_sweep(
        robot, robot.configuration(**POSE), "foot", [0, 1], np.linspace(1, 0.5, 11), axes="xz"
    )
    assert np.all(np.diff(table.hold[:-1]) > 0)
    assert table.hold[-1] == np.inf
    assert np.all(np.diff(table.lift) < 0)
    assert np.all(np.diff(table.impact_mitigation) < 0)
    np.testing.assert_allclose(table.inertia, table.inertia[0])
    assert table.backward_inertia[0] == pytest.approx(table.inertia[0])


def test_a_sweep_row_is_the_metric_of_that_robot() -> None:
    robot = load_robot("planar_leg")
    q = robot.configuration(**POSE)
    table = gear_ratio_sweep(robot, q, "foot", [0, 1], [5.0, 20.0, 80.0], axes="xz")
    unchanged = np.linalg.inv(backward_generalized_inertia(robot, q, "foot", "xz"))
    assert table.backward_inertia[1] == pytest.approx(1.0 / unchanged[1, 1])
    assert table.impact_mitigation[1] == pytest.approx(
        impact_mitigation(robot, q, "foot", "xz").along([0, 1])
    )
    np.testing.assert_allclose(table.conventional, [25.0, 100.0, 400.0])
    assert np.all(np.diff(table.impact_mitigation) < 0)


def test_both_efficiencies_can_be_given() -> None:
    robot = load_robot("planar_leg")
    table = efficiency_sweep(
        robot, robot.configuration(**POSE), "foot", [0, 1], [0.9, 0.5], [0.8, 0.9], axes="xz"
    )
    np.testing.assert_allclose(table.hold_ratio, [1 / 0.8, 1 / 0.9])
    with pytest.raises(TransmissionError, match="would create power"):
        efficiency_sweep(
            robot, robot.configuration(**POSE), "foot", [0, 1], [0.9], [1.2], axes="xz"
        )
    with pytest.raises(DynamicsError, match="backward_efficiencies has shape"):
        efficiency_sweep(robot, robot.neutral(), "foot", [0, 1], [0.9], [0.8, 0.8], axes="xz")


def test_a_straighter_leg_carries_more() -> None:
    robot = load_robot("planar_leg")
    knees = np.array([1.6, 1.2, 0.8, 0.4])
    poses = np.array([robot.configuration(hip=-k / 2, knee=k) for k in knees])
    table = pose_sweep(robot, poses, "foot", [0, 1], axes="xz")
    # Statics of two equal links with the foot under the hip: the knee's lever is L sin(knee/2).
    np.testing.assert_allclose(table.conventional, 20.0 / (0.4 * np.sin(knees / 2)))
    with pytest.raises(DynamicsError, match="singular"):
        pose_sweep(robot, np.zeros((1, 5)), "foot", [0, 1], axes="xz")


def test_self_locking_gears_on_a_fixed_base_are_infinitely_heavy() -> None:
    robot = load_robot("planar_leg_fixed")
    table = efficiency_sweep(robot, robot.pose("paper"), "foot", [0, 1], [0.45, 0.6], axes="xz")
    assert table.backward_inertia[0] == np.inf
    assert np.isnan(table.impact_mitigation[0])
    assert table.hold[0] == np.inf
    assert np.isfinite(table.inertia).all()
    assert table.backward_inertia[1] > table.inertia[1]
    # On a floating base the leg is a rigid body then, which mitigates nothing.
    floating = load_robot("planar_leg")
    rigid = efficiency_sweep(floating, floating.pose("paper"), "foot", [0, 1], [0.45], axes="xz")
    assert np.isfinite(rigid.backward_inertia[0])
    assert rigid.impact_mitigation[0] == pytest.approx(0.0, abs=1e-9)
    # One locked gear leaves the other one to give.
    gears = robot.transmission.replace(backward_efficiency=np.array([-0.2, 0.5]))
    partly = pose_sweep(
        robot.with_transmission(gears), robot.pose("paper")[None], "foot", [0, 1], axes="xz"
    )
    assert np.isfinite(partly.backward_inertia[0])
    assert partly.backward_inertia[0] > table.inertia[0]
