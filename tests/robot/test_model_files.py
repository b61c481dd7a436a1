"""What model files hold and lack: joints left out, loops, one table for all gears."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot
from wbc.control import Controller, PostureTask, RotorTorqueLimit
from wbc.control import JointLimit as Limit
from wbc.errors import RobotError
from wbc.robot import Motion
from wbc.robot.model_file import read_model
from wbc.sim import Plant

_LINK = (
    '<link name="{}"><inertial><mass value="1"/><origin xyz="0 0 -0.1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
_URDF = (
    '<robot name="r"><link name="base"/>'
    + _LINK.format("a")
    + _LINK.format("b")
    + '<joint name="one" type="continuous"><parent link="base"/><child link="a"/>'
    '<axis xyz="0 1 0"/></joint>'
    '<joint name="two" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="one" multiplier="2"/>'
    "</joint></robot>"
)
_MJCF = """<mujoco><worldbody>
<body name="a"><joint name="one" axis="0 1 0" stiffness="3" springref="10"/>
<geom type="sphere" size="0.1"/>
<body name="b" pos="0 0 -0.2"><joint name="two" axis="0 1 0"/><geom type="sphere" size="0.1"/>
</body></body></worldbody>
<equality><connect body1="b" body2="a" anchor="0 0 0"/><joint joint1="one" joint2="two"/></equality>
<actuator><motor joint="one" ctrlrange="-5 5"/></actuator>
<keyframe><key name="home" qpos="0 0"/></keyframe></mujoco>"""


def test_a_joint_that_mimics_another_is_named(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(_URDF, encoding="utf-8")
    model, notes = read_model(tmp_path / "r.urdf", "fixed", [])
    assert list(model.names)[1:] == ["one", "two"]
    (note,) = [note for note in notes if "mimics" in note]
    assert "'two' mimics 'one'" in note


@pytest.mark.parametrize(
    "text",
    [
        "equality 'connect' of b and a closes a loop",
        "equality 'joint' of one and two couples joints",
        "stiffness (one 3) was left out",
        "springref (one 10) was left out",
        "ctrlrange (one [-5 5]) was left out; give torque_limit",
        "keyframes (home) were left out",
    ],
)
def test_what_an_mjcf_holds_beside_its_tree_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "r.xml").write_text(_MJCF, encoding="utf-8")
    _, notes = read_model(tmp_path / "r.xml", "fixed", [])
    assert any(text in note for note in notes), notes


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
