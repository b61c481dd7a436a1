"""Models without a description of every joint: one table of gears, and loops that are no tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot
from wbc.control import Controller, PostureTask, RotorTorqueLimit
from wbc.control import JointLimit as Limit
from wbc.errors import RobotError
from wbc.robot import Motion
from wbc.sim import Plant

BAR = """<mujoco model="fourbar"><worldbody><body name="base" pos="0 0 1">
<inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
<body name="thigh"><inertial pos="0 0 -.15" mass=".5" diaginertia=".005 .005 .001"/>
<joint name="hip" axis="0 1 0"/>
<body name="shin" pos="0 0 -.3"><inertial pos="0 0 -.15" mass=".3" diaginertia=".003 .003 .001"/>
<joint name="knee" axis="0 1 0" range="-2 2"/></body></body>
<body name="crank" pos="-.05 0 0"><inertial pos="0 0 -.15" mass=".1" diaginertia=".001 .001 .001"/>
<joint name="motor" axis="0 1 0"/></body></body></worldbody>{loop}</mujoco>"""
LOOP = '<equality><connect body1="crank" body2="shin" anchor="0 0 -.3"/></equality>'
HEAD = 'name = "bar"\nmodel = "bar.xml"\nbase = "fixed"\n'
EVERY = """[gears."*"]
gear_ratio = { value = 9.0, unit = "1", source = "data sheet" }
rotor_inertia = { value = 1e-5, unit = "kg m^2", source = "data sheet" }
torque_limit = { value = 5.0, unit = "N m", source = "data sheet" }
"""


def described(folder: Path, text: str, loop: str = "") -> Path:
    (folder / "bar.xml").write_text(BAR.format(loop=loop))
    (folder / "robot.toml").write_text(text)
    return folder / "robot.toml"


def test_one_table_stands_for_all_gears_and_a_joints_own_adds_to_it(tmp_path: Path) -> None:
    own = '[gears.knee]\ngear_ratio = { value = 18.0, unit = "1", source = "data sheet" }\n'
    gears = load_robot(described(tmp_path, HEAD + EVERY + own)).transmission
    assert gears.joints == ("hip", "knee", "motor")
    np.testing.assert_array_equal(gears.gear_ratio, [9.0, 18.0, 9.0])
    np.testing.assert_array_equal(gears.rotor_inertia, [1e-5] * 3)


def test_a_closed_chain_is_refused_by_controller_and_plant(tmp_path: Path) -> None:
    robot = load_robot(described(tmp_path, HEAD + EVERY, LOOP))
    for make in (lambda: Controller(robot, [PostureTask.of(robot)]), lambda: Plant(robot)):
        with pytest.raises(RobotError, match="connect of crank and shin") as refused:
            make()
        assert "topology" in str(refused.value)
        assert "cut_loops" in str(refused.value)


def test_a_loop_cut_on_purpose_is_a_tree(tmp_path: Path) -> None:
    robot = load_robot(described(tmp_path, HEAD + "cut_loops = true\n" + EVERY, LOOP))
    command = Controller(robot, [PostureTask.of(robot)]).step(Motion(np.zeros(3), np.zeros(3)))
    assert command.status.usable
    Plant(robot)
    with pytest.raises(RobotError, match="cut_loops"):
        load_robot(described(tmp_path, HEAD + 'cut_loops = "yes"\n' + EVERY, LOOP))


def test_a_joint_limit_without_arguments_is_that_of_the_robot(tmp_path: Path) -> None:
    robot = load_robot(described(tmp_path, HEAD + EVERY))
    stop = Motion(np.array([0.0, 1.999, 0.0]), np.array([0.0, 0.5, 0.0]))
    tasks = [PostureTask.of(robot, ("hip", "motor")), PostureTask.of(robot, ("knee",), name="knee")]
    one, other = (
        Controller(robot, tasks, limits=[RotorTorqueLimit(), limit]).step(stop)
        for limit in (Limit(), Limit.of(robot))
    )
    np.testing.assert_array_equal(one.rotor_torque, other.rotor_torque)
    assert one.acceleration[1] < -80.0
