from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import RobotError, TransmissionError
from wbc.robot import Robot, bare_robot
from wbc.transmission import Transmission


def test_indices_behind_a_free_flyer() -> None:
    robot = load_robot("solo12")
    assert robot.has_free_flyer
    assert robot.floating_size == 6
    assert robot.position_index("FL_HAA") == 7
    assert robot.velocity_index("FL_HAA") == 6
    # The gears stand in their own order; the rows say where each joint is in v.
    for row, joint in zip(robot.actuated, robot.transmission.joints, strict=True):
        assert robot.velocity_index(joint) == row
    q = robot.configuration(HR_KFE=1.6)
    assert q[robot.position_index("HR_KFE")] == 1.6
    assert q[6] == 1.0


def test_unknown_names_list_those_that_exist() -> None:
    robot = load_robot("planar_leg")
    for ask in (
        lambda: robot.velocity_index("knie"),
        lambda: robot.configuration(knie=1.0),
        lambda: robot.body_of("knie"),
    ):
        with pytest.raises(RobotError, match="Did you mean 'knee'"):
            ask()
    with pytest.raises(RobotError, match="There are: foot"):
        robot.contact("toe")
    with pytest.raises(RobotError, match="thigh"):
        robot.body_joint("thig")


def test_armature_in_a_model_is_refused() -> None:
    model = load_robot("planar_leg_fixed").model.copy()
    model.armature = np.array([0.1, 0.0])
    with pytest.raises(RobotError, match="count twice"):
        bare_robot(model)


def test_a_gear_needs_a_joint_with_one_degree_of_freedom() -> None:
    model = load_robot("solo12").model
    gears = Transmission(("root_joint",), np.ones(1), np.zeros(1))
    with pytest.raises(RobotError, match="6 degrees of freedom"):
        Robot("x", model, gears)


def test_a_robot_without_gears() -> None:
    robot = bare_robot(load_robot("planar_leg").model)
    assert robot.transmission.size == 0
    assert robot.floating_size == robot.model.nv
    with pytest.raises(TransmissionError, match=r"There are: \(none\)"):
        robot.transmission.index("hip")
