from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.effects import PayloadMass, load_robot
from wbc.errors import RobotError, TransmissionError
from wbc.robot import ContactPoint, Robot, bare_robot
from wbc.transmission import Transmission


def test_indices_follow_pinocchio_s_order() -> None:
    robot = load_robot("planar_leg")
    assert robot.joints == ("base_x", "base_z", "base_pitch", "hip", "knee")
    np.testing.assert_array_equal(robot.actuated, [3, 4])
    np.testing.assert_array_equal(robot.unactuated, [0, 1, 2])
    assert robot.velocity_index("knee") == 4
    assert robot.body_of("knee") == "shin"
    assert robot.body_joint("thigh") == robot.model.getJointId("hip")
    assert not robot.has_free_flyer


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


def test_copies_leave_the_original_alone() -> None:
    robot = load_robot("planar_leg")
    mass = robot.model.inertias[4].mass
    heavier = robot.with_inertia(
        4, robot.model.inertias[4] + pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3)))
    )
    moon = robot.with_gravity([0.0, 0.0, -1.62])
    assert heavier.model.inertias[4].mass == mass + 1.0
    assert robot.model.inertias[4].mass == mass
    assert robot.model.gravity.linear[2] == -9.81
    assert moon.model.gravity.linear[2] == -1.62
    with pytest.raises(RobotError, match="shape"):
        robot.with_gravity([0.0, -9.81])


def test_only_effects_keep_the_way_back_to_the_file() -> None:
    robot = load_robot("planar_leg")
    effect = PayloadMass("base", 1.0)
    assert robot.source is not None
    assert robot.with_effect(effect).source == robot.source
    assert robot.lossless().source is not None
    assert robot.lossless().source.lossless
    for changed in (
        robot.with_transmission(robot.transmission.lossless()),
        robot.with_gravity([0.0, 0.0, -1.0]),
        robot.with_effect(effect).lossless(),
    ):
        assert changed.source is None


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


def test_a_contact_needs_a_frame_and_finite_numbers() -> None:
    robot = load_robot("planar_leg_fixed")
    with pytest.raises(RobotError, match="Unknown frame"):
        Robot("x", robot.model, robot.transmission, (ContactPoint("a", "hoof", np.zeros(3)),))
    with pytest.raises(RobotError, match="finite"):
        ContactPoint("a", "foot", np.array([0.0, np.nan, 0.0]))
    with pytest.raises(RobotError, match="friction"):
        ContactPoint("a", "foot", np.zeros(3), friction=np.nan)


def test_a_robot_without_gears() -> None:
    robot = bare_robot(load_robot("planar_leg").model)
    assert robot.transmission.size == 0
    assert robot.floating_size == robot.model.nv
    with pytest.raises(TransmissionError, match=r"There are: \(none\)"):
        robot.transmission.index("hip")
