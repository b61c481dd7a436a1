"""A saved robot is the robot again, and every mistake in such a file is named."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from wbc import effects
from wbc.effects import CoulombFriction, load_robot, save_robot
from wbc.errors import EffectError, RobotError
from wbc.robot import robots_directory

FITTED = """
robot = "planar_leg"
lossless = true
[[effects]]
effect = "coulomb_friction"
where = "knee"
parameters = { level = { value = 350.0, unit = "mN m", low = 0.3, high = 0.4 } }
[[effects]]
effect = "payload_mass"
where = "base"
parameters = { mass = 2 }
"""


@pytest.mark.parametrize("lossless", [False, True])
@pytest.mark.parametrize("name", ["planar_leg", "solo12"])
def test_round_trip(tmp_path: Path, name: str, lossless: bool) -> None:
    robot = load_robot(name).lossless() if lossless else load_robot(name)
    joint = robot.transmission.joints[-1]
    robot = robot.with_effects(
        CoulombFriction(joint, 0.123456789012345),
        effects.TransmissionEfficiency(joint, 0.81, 1.0 / 3.0),
        effects.PayloadMass(robot.contacts[0].name, -0.001),
        effects.TorqueRipple(joint, 0.2, 17.5, -1.0),
    )
    path = save_robot(robot, tmp_path / "deep" / "fitted.toml")
    again = load_robot(path)
    assert (again.effects, again.source) == (robot.effects, robot.source)
    for number in ("forward_efficiency", "backward_efficiency"):
        ours, theirs = (getattr(one.transmission, number) for one in (again, robot))
        np.testing.assert_array_equal(ours, theirs)
    assert list(again.model.inertias) == list(robot.model.inertias)
    more = again.with_effect(CoulombFriction(joint, 0.5))
    assert load_robot(save_robot(more, path)).effects == more.effects


def test_a_robot_of_one_s_own_is_found_again_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "own"
    own.mkdir()
    text = (robots_directory() / "planar_leg_fixed" / "robot.toml").read_text()
    (own / "robot.toml").write_text(text.replace("../", f"{robots_directory().as_posix()}/"))
    monkeypatch.chdir(tmp_path)
    path = save_robot(load_robot("own"), tmp_path / "fitted.toml")
    monkeypatch.chdir("/")
    assert load_robot(path).joints == ("hip", "knee")


def test_units_intervals_and_provenance(tmp_path: Path) -> None:
    path = tmp_path / "fitted.toml"
    path.write_text(FITTED)
    (tmp_path / "planar_leg").mkdir()  # a folder that happens to have the robot's name
    robot = load_robot(path)
    assert robot.name == "planar_leg"
    assert robot.effects[0].values == {"level": pytest.approx(0.35)}
    assert robot.effects[1].values == {"mass": 2.0}
    np.testing.assert_array_equal(robot.transmission.forward_efficiency, 1.0)
    intervals = {("coulomb_friction", "knee", "level"): (0.3, 0.4)}
    saved = save_robot(robot, tmp_path / "again.toml", intervals, {"logs": "a.csv"})
    table = tomllib.loads(saved.read_text())
    assert table["provenance"] == {"logs": "a.csv"}
    level = table["effects"][0]["parameters"]["level"]
    assert level == {"value": pytest.approx(0.35), "unit": "N m", "low": 0.3, "high": 0.4}
    assert load_robot(saved).effects == robot.effects


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('"planar_leg"', '"planar_lge"', RobotError, "Did you mean 'planar_leg'"),
        ("lossless", "losless", RobotError, "Did you mean 'lossless'"),
        ("coulomb_friction", "coulom_friction", EffectError, "Did you mean 'coulomb_friction'"),
        ('where = "knee"', "", RobotError, "lacks the key 'where'"),
        ('where = "knee"', 'where = "knie"', EffectError, "Did you mean 'knee'"),
        ("level =", "lewel =", EffectError, "Did you mean 'level'"),
        ("350.0", "-1.0", EffectError, "lies outside"),
        ("350.0", '"much"', RobotError, "coulomb_friction at 'knee': level: 'much' is not a num"),
        ("value = 350.0, ", "", RobotError, "the key 'value' is missing"),
        ('"mN m"', '"kg"', RobotError, "unit 'kg' measures [kg], expected [N m]"),
        ('robot = "planar_leg"', 'robot = "fitted.toml"', RobotError, "refers back to this file"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, error: type, message: str) -> None:
    assert old in FITTED
    path = tmp_path / "fitted.toml"
    path.write_text(FITTED.replace(old, new, 1))
    with pytest.raises(error, match=re.escape(message)):
        load_robot(path)


def test_the_side_of_friction_beside_a_soft_gear_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "fitted.toml"
    for side in ("motor", "link", "either"):
        gear = effects.JointCompliance("knee", 400.0, 1.0).with_friction_at(side)
        robot = load_robot("planar_leg").with_effects(gear, CoulombFriction("knee", 0.3))
        save_robot(robot, path)
        assert load_robot(path).effects == robot.effects
    text = save_robot(robot.with_effect(gear.with_friction_at("motor")), path).read_text()
    for old, new, message in (
        ('"motor"', '"gear"', "'gear' is none of link, motor, either"),
        ('"motor"', "3", "3 stands where a str is expected"),
        ("friction_side", "friction_sid", "Did you mean 'friction_side'"),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(RobotError, match=message):
            load_robot(path)
