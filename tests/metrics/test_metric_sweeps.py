from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import DynamicsError
from wbc.metrics import (
    sweep,
)


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
