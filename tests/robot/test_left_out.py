"""What a model file holds and the robot does not is named when it is loaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from wbc.robot.loading.model_file import read_model

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
