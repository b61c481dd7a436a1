"""Robots and numbers as designers bring them: each of these once hung, crashed or said nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc.cli import main
from wbc.design.experiment import (
    MotionLimits,
    Rivals,
    deciding,
    design_experiment,
    parse_cause,
    random_paths,
)
from wbc.effects import load_robot
from wbc.errors import DesignError
from wbc.robot import Robot

LEG = load_robot("planar_leg_fixed").lossless()

JOINT = """
<joint name="j{k}" type="{kind}"><parent link="l{before}"/><child link="l{k}"/>
<origin xyz="0 0 0.2"/><axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="2" effort="50"/>
</joint><link name="l{k}"><inertial><origin xyz="0.01 0 0.1"/><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 0 1")
GEAR = """
[gears.j{k}]
gear_ratio = {{ value = 50.0, unit = "1", source = "test" }}
rotor_inertia = {{ value = 1e-5, unit = "kg m^2", source = "test" }}
torque_limit = {{ value = {limit}, unit = "N m", source = "test" }}
"""


def chain(folder: Path, joints: int, slides: tuple[int, ...] = (), limit: float = 1.5) -> Path:
    """Write an arm that stands straight up, some of its joints slides."""
    links = '<robot name="chain"><link name="l0"/>'
    gears = 'name = "chain"\nmodel = "chain.urdf"\nbase = "fixed"\n'
    for k in range(1, joints + 1):
        kind = "prismatic" if k in slides else "revolute"
        links += JOINT.format(k=k, kind=kind, before=k - 1, axis=AXES[k - 1], mass=3.0 - 0.3 * k)
        gears += GEAR.format(k=k, limit=limit)
    (folder / "chain.urdf").write_text(links + "</robot>")
    path = folder / "chain.toml"
    path.write_text(gears)
    return path


def rivals(robot: Robot, *texts: str) -> Rivals:
    causes = tuple(parse_cause(text, robot) for text in texts)
    return Rivals(robot, causes, np.full(robot.transmission.size, 0.01))


@pytest.mark.parametrize(
    ("joints", "slides", "texts"),
    [
        (7, (), ("payload_mass@l7", "rotor_inertia@j6")),
        (4, (3,), ("payload_mass@l4", "viscous_friction@j3")),
    ],
)
def test_seven_axes_and_slides_are_planned(
    tmp_path: Path, joints: int, slides: tuple[int, ...], texts: tuple[str, ...]
) -> None:
    robot = load_robot(str(chain(tmp_path, joints, slides)))
    chosen, limits = rivals(robot, *texts), MotionLimits.of(robot)
    found = design_experiment(chosen, limits, 2.0, rounds=2)
    assert found.used <= 0.81
    assert found.worst > 0.0


def test_motors_that_cannot_hold_the_robot_still_are_named(tmp_path: Path) -> None:
    """A slide that carries 60 N with a motor of 1.5 N m at 50 per metre, at most 75 N."""
    robot = load_robot(str(chain(tmp_path, 4, (1,), limit=1.5)))
    chosen, limits = rivals(robot, "payload_mass@l4", "viscous_friction@j3"), MotionLimits.of(robot)
    message = r"holding still takes 1\d\d % of the torque limit of 'j1'"
    with pytest.raises(DesignError, match=message):
        next(random_paths(chosen, limits, 2.0, 0, 1))
    with pytest.raises(DesignError, match=message):
        design_experiment(chosen, limits, 2.0, rounds=2)


def test_a_short_motion_keeps_its_limits_at_the_rate_of_the_log() -> None:
    """Half a second has 26 rows of the search, between which its peaks lie."""
    chosen = rivals(LEG, "payload_mass@shin", "rotor_inertia@knee")
    limits = MotionLimits.of(LEG, span=1.0, speed=6.0, acceleration=100.0)
    assert design_experiment(chosen, limits, 0.5, rounds=3, aim=deciding).used <= 0.8


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"duration": np.nan}, "duration of an experiment must be > 0 and finite, got nan"),
        ({"duration": np.inf}, "duration of an experiment must be > 0 and finite, got inf"),
        ({"duration": -1.0}, "duration of an experiment must be > 0 and finite, got -1"),
        ({"rate": np.nan}, "needs 10 rows per second or more; the rate is nan"),
        ({"rate": 1.0}, "needs 10 rows per second or more; the rate is 1"),
        ({"rate": np.inf}, "rate of an experiment must be > 0 and finite, got inf"),
    ],
)
def test_a_time_or_rate_that_is_none_is_named(settings: dict[str, float], message: str) -> None:
    chosen = rivals(LEG, "viscous_friction@knee", "coulomb_friction@knee")
    given = {"duration": 2.0, "rate": 100.0, **settings}
    with pytest.raises(DesignError, match=message):
        design_experiment(chosen, MotionLimits.of(LEG, speed=6.0), rounds=1, **given)  # type: ignore[arg-type]


def test_a_front_without_designs_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A straight leg: infinite force, infinite inertia."""
    out = tmp_path / "straight.parquet"
    options = f"--pose knee=0 --sweep reduction=20:100:3 --out {out}"
    assert main(["design", "planar_leg_fixed", *options.split()]) == 0
    assert "No design can be judged" in " ".join(capsys.readouterr().out.split())
    other = f"--pose paper --sweep reduction=20:100:3 --out {tmp_path}/bent.parquet"
    assert main(["design", "planar_leg", *other.split()]) == 0
    assert "No design can be judged" not in capsys.readouterr().out
