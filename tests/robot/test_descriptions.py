"""Descriptions and model files: what they may say, and what mistakes in them are answered with."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from wbc.control import Controller, PostureTask
from wbc.effects import load_robot
from wbc.errors import RobotError, TransmissionError, WbcError
from wbc.robot import Motion, robot_names, robots_directory
from wbc.robot.description import find_description
from wbc.sim import Plant

LEG = """
name = "leg"
model = "planar_leg.urdf"
lock = ["base_x", "base_z", "base_pitch"]
[gears.hip]
gear_ratio = { value = 20.0, unit = "1", source = "x" }
rotor_inertia = { value = 667.0, unit = "g cm^2", source = "x" }
forward_efficiency = { value = 0.8, unit = "1", source = "x" }
[gears.knee]
gear_ratio = 20
rotor_inertia = 6.67e-5
backward_efficiency = 0.5
torque_limit = { value = 900.0, unit = "mN m" }
speed_limit = { value = 3000.0, unit = "rpm" }
backlash = { value = 6.0, unit = "arcmin" }
[[contacts]]
name = "foot"
frame = "foot"
offset = { value = [0.0, 0.0, -25.0], unit = "mm" }
"""

HIP, FOOT = "[gears.hip]", '[[contacts]]\nname = "foot"\nframe = "shin"\n'
CROUCH = "[poses.crouch]\n"

MODEL = """<mujoco><worldbody><body name="torso" pos="0 0 1">{free}
<inertial pos="0 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
<body name="arm" pos="0 0 0.1"><joint name="elbow" type="hinge" axis="0 1 0" armature="0.3"
 damping="0.2" frictionloss="0.1"/><inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
</body></body></worldbody><actuator><motor joint="elbow" gear="5"/></actuator></mujoco>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(robots_directory() / "planar_leg" / "planar_leg.urdf", tmp_path)
    return tmp_path


def write(folder: Path, text: str) -> Path:
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_units_and_defaults(folder: Path) -> None:
    moon = 'gravity = { value = [0.0, 0.0, -1.62], unit = "m/s^2" }\n'
    robot = load_robot(write(folder, moon + LEG))
    gears, model = robot.transmission, robot.model
    np.testing.assert_array_equal(model.gravity.linear, [0.0, 0.0, -1.62])
    np.testing.assert_array_equal(model.lowerVelocityLimit, -model.upperVelocityLimit)
    np.testing.assert_allclose(gears.rotor_inertia, [6.67e-5, 6.67e-5])
    np.testing.assert_allclose(gears.forward_efficiency, [0.8, 1.0])
    np.testing.assert_allclose(gears.backward_efficiency, [2 - 1 / 0.8, 0.5])
    np.testing.assert_allclose(gears.torque_limit, [np.inf, 0.9])
    np.testing.assert_allclose(gears.speed_limit, [np.inf, 3000 * 2 * np.pi / 60])
    np.testing.assert_allclose(gears.backlash, [0.0, np.deg2rad(0.1)])
    assert np.isnan(gears.torque_constant).all()
    np.testing.assert_allclose(robot.contact("foot").offset, [0.0, 0.0, -0.025])
    assert robot.joints == ("hip", "knee")
    assert load_robot(folder).joints == robot.joints
    slide = LEG.replace('20.0, unit = "1"', '35.7, unit = "rad/m"')
    assert load_robot(write(folder, slide)).transmission.gear_ratio[0] == 35.7


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "leg"', 'nmae = "leg"', "Unknown key 'nmae'. Did you mean 'name'"),
        ('model = "planar_leg.urdf"', "", "the key 'model' is missing"),
        ("planar_leg.urdf", "planar_arm.urdf", "planar_arm.urdf' is not in"),
        ("planar_leg.urdf", "robot.toml", "ends in .urdf or .xml"),
        ('["base_x", "base_z", "base_pitch"]', '["base_y"]', "Unknown joint 'base_y'"),
        ('["base_x", "base_z", "base_pitch"]', '"base_x"', "a list of joint names"),
        ("[gears.knee]", "[gears.kne]", "Unknown joint of 'leg' 'kne'. Did you mean 'knee'"),
        ("gear_ratio = 20", "gear_ration = 20", "gear of 'knee': Unknown key 'gear_ration'"),
        ("gear_ratio = 20", "", "gear of 'knee': the key 'gear_ratio' is missing"),
        ("gear_ratio = 20", 'gear_ratio = "20"', "gear of 'knee': gear_ratio: '20' is not a num"),
        ("gear_ratio = 20", "gear_ratio = true", "True is not a number"),
        ("gear_ratio = 20", "gear_ratio = [20, 20]", "one number expected"),
        ("gear_ratio = 20", "gear_ratio = [20, [1]]", "differ in length"),
        ("gear_ratio = 20", "gear_ratio = { unit = '1' }", "the key 'value' is missing"),
        ("gear_ratio = 20", "gear_ratio = { value = 20, units = 'g' }", "Did you mean 'unit'"),
        ('"mN m"', '"Nmm"', "Unknown unit 'Nmm'"),
        ('"mN m"', '"rad"', r"unit 'rad' measures [rad], expected [N m]"),
        ("[[contacts]]", "[transmission]\nrotor_couplng = true\n[[contacts]]", "rotor_couplng"),
        ("[[contacts]]", "[transmission]\nrotor_coupling = 1\n[[contacts]]", "true or false"),
        ("[[contacts]]", "[contacts]", "a list of tables expected"),
        ('frame = "foot"', "", "a contact lacks the key 'frame'"),
        ('frame = "foot"', 'frame = "toe"', "Unknown frame of 'leg' 'toe'"),
        ('frame = "foot"', 'frame = "foot"\nmu = 1', "Unknown key 'mu'"),
        ('frame = "foot"', 'frame = "foot"\nfriction = -1', "friction must be >= 0"),
        ("[0.0, 0.0, -25.0]", "[0.0, 0.0]", "offset of contact 'foot' has shape"),
        ('name = "leg"', 'name = "leg"\ngravity = 9.81', "gravity has shape ()"),
        ('name = "leg"', 'name = "leg"\nbase = "flying"', "Unknown base 'flying'"),
        ("[gears.hip]", "[gears.hip", "Expected ']'"),
        # tests/transmission asks every field; here, both forms in which a description writes one
        ("value = 0.8", "value = 1.3", "got 1.3"),
        ("inertia = 6.67e-5", "inertia = -6.67e-5", "rotor_inertia"),
        ("[[contacts]]", FOOT + "[[contacts]]", "two contacts of one name"),
        ("planar_leg.urdf", "no_such_package:leg.urdf", "pip install no-such-package"),
        ("planar_leg.urdf", ":leg.urdf", "not installed"),
        ("planar_leg.urdf", "example_robot_data:robots/none.urdf", "not installed"),
        ('name = "leg"', 'cut_loops = "yes"', "cut_loops"),
        (HIP, f"{CROUCH}knie = 1.0\n{HIP}", "pose 'crouch': Unknown joint 'knie'. Did you mean 'k"),
        (HIP, f"{CROUCH}knee = {{value = 1, unit = 'mm'}}\n{HIP}", "measures [m], expected [rad]"),
        (HIP, f"{CROUCH}knee = 'bent'\n{HIP}", "'bent' is not a number"),
        (HIP, f"{CROUCH}'base.position.z' = 1.0\n{HIP}", "Unknown joint 'base.position.z'"),
        (HIP, f"[poses]\ntall = 3\n{HIP}", "a table of joints expected, got 3"),
    ],
)
def test_mistakes_are_named_with_their_place(
    folder: Path, old: str, new: str, message: str
) -> None:
    assert old in LEG
    path = write(folder, LEG.replace(old, new, 1))
    with pytest.raises((RobotError, TransmissionError), match=re.escape(message)):
        load_robot(path)


def test_unknown_robots_list_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="Did you mean 'planar_leg'"):
        load_robot("planar_lge")
    with pytest.raises(RobotError, match=r"no robot description at .*none\.toml"):
        load_robot(tmp_path / "none.toml")
    assert all(find_description(name).is_file() for name in robot_names())


BROKEN = [("planar_leg.urdf", text) for text in ("<robot><link", "", "<robot name='x'/>")]


@pytest.mark.parametrize(("file", "content"), [*BROKEN, ("leg.xml", "<mujoco><worldbody>")])
def test_a_broken_file_is_named(folder: Path, file: str, content: str) -> None:
    (folder / file).write_text(content)
    path = write(folder, LEG.replace("planar_leg.urdf", file))
    with pytest.raises(WbcError, match=re.escape(file)):
        load_robot(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RobotError, match="cannot read the robot description"):
        load_robot(path)


GEAR = "[gears.elbow]\ngear_ratio = 5\nrotor_inertia = 0.001\n"


FREE = "<freejoint/>"
STATED = [("", "fixed", 1), ("", "free_flyer", 7)]
BASES = [*STATED, (FREE, "", 7), (FREE, "fixed", 1), (FREE, "free_flyer", 7)]


@pytest.mark.parametrize(("free", "base", "coordinates"), BASES)
def test_mjcf_with_and_without_a_free_base(
    tmp_path: Path, free: str, base: str, coordinates: int
) -> None:
    (tmp_path / "arm.xml").write_text(MODEL.format(free=free))
    stated = f'base = "{base}"\n' if base else ""
    robot = load_robot(write(tmp_path, f'model = "arm.xml"\n{stated}' + GEAR))
    assert robot.model.nv == coordinates
    assert robot.has_free_flyer == (coordinates == 7)
    assert robot.floating_size == coordinates - 1
    assert robot.single_joints == ("elbow",)


def test_what_a_model_file_holds_of_the_gears_is_set_aside_and_said(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(MODEL.format(free=""))
    robot = load_robot(write(tmp_path, 'model = "arm.xml"\n' + GEAR))
    for word in ("armature (0.3)", "damping (0.2)", "friction (0.1)", "<actuator>"):
        assert word in "\n".join(robot.notes)
    for name in ("armature", "damping", "upperDryFrictionLimit", "lowerDryFrictionLimit"):
        np.testing.assert_array_equal(getattr(robot.model, name), 0.0)


def test_what_a_urdf_holds_beside_its_links_is_set_aside_and_said(folder: Path) -> None:
    urdf = folder / "planar_leg.urdf"
    limit = '<limit lower="-3.2" upper="3.2" effort="1000" velocity="100"/>'
    hip, knee, rest = urdf.read_text().split(limit)
    dry = limit + '<dynamics damping="0.7" friction="0.4"/>'
    end = rest.replace("</robot>", '<transmission name="t"/></robot>')
    urdf.write_text(hip + dry + knee + dry + '<mimic joint="hip" multiplier="2"/>' + end)
    robot = load_robot(write(folder, LEG))
    dropped = "damping (0.7, 0.7)", "friction (0.4, 0.4)", "<transmission> was ignored"
    for words in (*dropped, "'knee' mimics 'hip'"):
        assert words in "\n".join(robot.notes)
    assert robot.joints == ("hip", "knee")
    np.testing.assert_array_equal(robot.model.damping, 0.0)


def test_an_inertia_that_no_body_has_is_named_with_its_link_and_axis(folder: Path) -> None:
    urdf = folder / "planar_leg.urdf"
    text = urdf.read_text()
    first = text[text.index("<inertia ") : text.index("/>", text.index("<inertia ")) + 2]
    wrong = '<inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0.2" ixz="0" iyz="0"/>'
    urdf.write_text(text.replace(first, wrong, 1))
    said = r"link '.*' is not positive definite.* axis \(0\.79, -0\.62"
    with pytest.raises(RobotError, match=said):
        load_robot(write(folder, LEG))
    urdf.write_text(text.replace(first, wrong.replace('iyy="0.2"', 'iyy="0.9"'), 1))
    assert any("that of no body" in note for note in load_robot(write(folder, LEG)).notes)


BAR = """<mujoco model="fourbar"><worldbody><body name="base" pos="0 0 1">
<inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
<body name="thigh"><inertial pos="0 0 -.15" mass=".5" diaginertia=".005 .005 .001"/>
<joint name="hip" axis="0 1 0" stiffness="3" springref="10"/>
<body name="shin" pos="0 0 -.3"><inertial pos="0 0 -.15" mass=".3" diaginertia=".003 .003 .001"/>
<joint name="knee" axis="0 1 0" range="-2 2"/></body></body>
<body name="crank" pos="-.05 0 0"><inertial pos="0 0 -.15" mass=".1" diaginertia=".001 .001 .001"/>
<joint name="motor" axis="0 1 0"/></body></body></worldbody>{loop}</mujoco>"""
LOOP = '<equality><connect body1="crank" body2="shin" anchor="0 0 -.3"/></equality>'
HEAD = 'name = "bar"\nmodel = "bar.xml"\nbase = "fixed"\n'
EVERY = '[gears."*"]\ngear_ratio = 9\nrotor_inertia = 1e-5\ntorque_limit = 5\n'


def described(folder: Path, text: str, loop: str = "") -> Path:
    (folder / "bar.xml").write_text(BAR.format(loop=loop))
    return write(folder, text)


MORE = """<equality><joint joint1="hip" joint2="knee"/></equality>
<actuator><motor joint="hip" ctrlrange="-5 5"/></actuator>
<keyframe><key name="home" qpos="0 0 0"/></keyframe>"""


def test_what_an_mjcf_holds_beside_its_tree_is_named(tmp_path: Path) -> None:
    notes = "\n".join(load_robot(described(tmp_path, HEAD + EVERY, LOOP + MORE)).notes)
    for text in (
        "equality 'connect' of crank and shin closes a loop",
        "equality 'joint' of hip and knee couples joints",
        "stiffness (hip 3) was left out",
        "springref (hip 10) was left out",
        "ctrlrange (hip [-5 5]) was left out; give torque_limit",
        "keyframes (home) were left out",
    ):
        assert text in notes


def test_one_table_stands_for_all_gears_and_a_joints_own_adds_to_it(tmp_path: Path) -> None:
    own = "[gears.knee]\ngear_ratio = 18\n"
    gears = load_robot(described(tmp_path, HEAD + EVERY + own)).transmission
    assert gears.joints == ("hip", "knee", "motor")
    np.testing.assert_array_equal(gears.gear_ratio, [9.0, 18.0, 9.0])
    np.testing.assert_array_equal(gears.rotor_inertia, [1e-5] * 3)


def test_the_drive_of_a_slide_has_gains_in_its_own_units(tmp_path: Path) -> None:
    given = shutil.copytree(robots_directory() / "emps", tmp_path / "emps") / "robot.toml"
    gains = """kp = { value = 4e5, unit = "N/m", source = "set" }
kd = { value = 3e3, unit = "N s/m", source = "set" }
"""
    given.write_text(given.read_text() + gains)
    gears = load_robot(given).transmission
    assert (gears.position_gain[0], gears.velocity_gain[0]) == (4e5, 3e3)


def test_a_closed_chain_is_refused_by_controller_and_plant_unless_cut(tmp_path: Path) -> None:
    robot = load_robot(described(tmp_path, HEAD + EVERY, LOOP))
    for make in (lambda: Controller(robot, [PostureTask.of(robot)]), lambda: Plant(robot)):
        with pytest.raises(RobotError, match="connect of crank and shin") as refused:
            make()
        assert {"topology", "cut_loops"} <= set(re.findall(r"\w+", str(refused.value)))
    robot = load_robot(described(tmp_path, HEAD + "cut_loops = true\n" + EVERY, LOOP))
    command = Controller(robot, [PostureTask.of(robot)]).step(Motion(np.zeros(3), np.zeros(3)))
    assert command.status.usable
    Plant(robot)
