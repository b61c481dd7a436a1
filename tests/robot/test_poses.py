from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import RobotError
from wbc.robot import robots_directory

TEXT = """
model = "{folder}/planar_leg/planar_leg.urdf"
[poses.crouch]
base_z = {{ value = 500.0, unit = "mm" }}
knee = {{ value = 90.0, unit = "deg" }}
[poses.tall]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "robot.toml"
    path.write_text(text.format(folder=robots_directory().as_posix()))
    return path


def test_poses_are_named_in_order_with_units(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, TEXT))
    np.testing.assert_allclose(robot.pose("crouch"), [0.0, 0.5, 0.0, 0.0, np.pi / 2])
    np.testing.assert_array_equal(robot.pose("tall"), np.zeros(5))
    np.testing.assert_array_equal(robot.pose(), robot.pose("crouch"))
    robot.pose()[0] = 1.0
    assert robot.pose()[0] == 0.0


def test_a_free_base_is_placed() -> None:
    robot = load_robot("talos")
    q = robot.pose("half_sitting")
    assert q[2] == pytest.approx(1.01927, abs=1e-5)
    np.testing.assert_array_equal(q[3:7], [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("knee =", "knie =", "pose 'crouch': Unknown joint 'knie'. Did you mean 'knee'"),
        ('unit = "deg"', 'unit = "mm"', "measures [m], expected [rad]"),
        ('unit = "mm"', 'unit = "deg"', "measures [rad], expected [m]"),
        ("90.0", '"bent"', "'bent' is not a number"),
        ("[poses.tall]", "[poses]\ntall = 3", "a table of joints expected, got 3"),
        ("base_z =", '"base.position.z" =', "Unknown joint 'base.position.z'"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(RobotError, match=re.escape(message)):
        load_robot(write(tmp_path, TEXT.replace(old, new, 1)))


def test_unknown_poses_list_the_known_ones(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, TEXT))
    with pytest.raises(RobotError, match="There are: crouch, tall"):
        robot.pose("sitting")
    bare = load_robot(write(tmp_path, TEXT[: TEXT.index("[poses")]))
    with pytest.raises(RobotError, match=r"There are: \(none\)"):
        bare.pose()
