"""Robots whose links are not as drawn, or rub far more than they need: no column is wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.moved import moved
from wbc.effects import LoadFriction, load_robot
from wbc.identification.readings import find_suspicions
from wbc.measurement import Log, mended
from wbc.robot import Robot

_UPPER = "<joint name='shoulder' axis='0 1 0'/>"
_UPPER += "<inertial pos='0 0 -.2' mass='2' diaginertia='.03 .03 .01'/>"
_LOWER = "<inertial pos='0 0 -.3' mass='2' diaginertia='.03 .03 .01'/>"


def written_arm(folder: Path, *bodies: tuple[str, str]) -> Robot:
    """Return an arm of bodies (place, what they hold), each behind the one before."""
    text = "".join(f"<body pos='{place}'>{held}" for place, held in bodies)
    text += "</body>" * len(bodies)
    (folder / "arm.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    gear = '[gears."*"]\ngear_ratio = { value = 2.0, unit = "1", source = "given" }\n'
    gear += 'rotor_inertia = { value = 0.0, unit = "kg m^2", source = "given" }\n'
    (folder / "robot.toml").write_text(f'name = "arm"\nmodel = "arm.xml"\nbase = "fixed"\n{gear}')
    return load_robot(folder / "robot.toml")


def rubbing(robot: Robot) -> Log:
    """Return a log of an arm whose joints rub by a tenth of what they need."""
    waves = [[(0.8, r, 0.0), (0.4, 2.2 * r, 1.0)] for r in (1.1, 1.7, 2.3)]
    waves = waves[: len(robot.joints)]
    log = moved(robot, np.arange(0.0, 20.0, 0.01), waves, (0.0, 0.0, 0.0))
    rubs = {}
    for joint in robot.joints:
        torque, speed = log.column(f"{joint}.rotor_torque"), log.column(f"{joint}.velocity")
        rubs[f"{joint}.rotor_torque"] = torque + 0.1 * np.std(torque) * np.tanh(speed / 0.02)
    return log.with_columns(rubs)


def arm_of(center: float, folder: Path) -> Robot:
    """Return an arm whose wrist carries its mass at a height, and a hand that rolls."""
    wrist = f"<inertial pos='0 0 {center}' mass='.4' diaginertia='8e-4 8e-4 8e-4'/>"
    hand = "<inertial pos='.01 0 0' mass='.02' diaginertia='2e-5 2e-5 2e-5'/>"
    return written_arm(
        folder,
        ("0 0 0", _UPPER),
        ("0 0 -.4", f"<joint name='wrist' axis='0 1 0'/>{wrist}"),
        ("0 0 -.2", f"<joint name='roll' axis='0 0 1'/>{hand}"),
    )


@pytest.mark.parametrize("center", [0.08, 0.12])
def test_a_link_whose_mass_is_elsewhere_is_no_wrong_column(center: float, tmp_path: Path) -> None:
    """Right logs of an arm with guessed inertias were refused: a zero, or a sign, was another."""
    log = rubbing(arm_of(center, tmp_path))
    assert find_suspicions([log], arm_of(-0.08, tmp_path)) == [[]]


def test_what_joints_behind_report_tells_a_zero_from_links(tmp_path: Path) -> None:
    """The share of all joints was said, 98 % as it stands; it hid the one that was read wrong."""
    robot = arm_of(-0.08, tmp_path)
    off = mended(rubbing(robot), {"columns": {"wrist.position": {"offset": np.pi}}})
    ((finding,),) = find_suspicions([off], robot)
    assert (finding.kind, finding.severity) == ("position_zero", "error")
    assert "100 % of the power of the torque of wrist, and 0 % as it stands" in finding.text


def test_links_and_a_zero_that_need_the_same_torque_are_both_named(tmp_path: Path) -> None:
    wrist = "<inertial pos='0 0 -.08' mass='.4' diaginertia='8e-4 8e-4 8e-4'/>"
    wrist = f"<joint name='wrist' axis='0 1 0'/>{wrist}"
    robot = written_arm(tmp_path, ("0 0 0", _UPPER), ("0 0 -.4", wrist))
    off = mended(rubbing(robot), {"columns": {"wrist.position": {"offset": np.pi}}})
    ((finding,),) = find_suspicions([off], robot)
    assert finding.severity == "warning"
    assert "the zero of wrist.position is off by" in finding.text
    assert "or links that wrist moves are not as drawn" in finding.text
    assert "correct their inertias" in finding.way_out
    assert not finding.mend


def test_torques_of_one_joint_far_above_the_need_are_no_other_column(tmp_path: Path) -> None:
    """A reading was told that explained them as well as before, on a UR10 less: 13 % after 32 %."""
    robot = arm_of(-0.08, tmp_path)
    log, name = rubbing(robot), "wrist.rotor_torque"
    larger = log.with_columns({name: 15.0 * log.column(name)})
    ((finding,),) = find_suspicions([larger], robot)
    assert finding.text == "torques of wrist are 15 times what the links need."
    # `compare` doubted each robot so that `diagnose` had saved with losses of its gears.
    assert find_suspicions([larger], robot.with_effect(LoadFriction("wrist", 0.2))) == [[]]


def test_no_gravity_of_a_planar_arm_is_not_told_as_three_mistakes(tmp_path: Path) -> None:
    wrist = "<joint name='wrist' axis='0 1 0'/>"
    wrist += "<inertial pos='0 0 -.08' mass='.4' diaginertia='8e-4 8e-4 8e-4'/>"
    robot = written_arm(tmp_path, ("0 0 0", _UPPER), ("0 0 -.4", wrist))
    for pull, kind in (((0.0, 0.0, 0.0), "no_gravity"), ((9.81, 0.0, 0.0), "gravity_direction")):
        ((finding,),) = find_suspicions([rubbing(robot.with_gravity(pull))], robot)
        assert (finding.kind, finding.severity) == (kind, "error")
        assert "+y" not in finding.text


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motor_that_turns_with_two_joints_is_named(sign: float, tmp_path: Path) -> None:
    """Of a leg with a parallelogram that nobody had described ten doubtful causes were told."""
    wrist = f"<joint name='wrist' axis='0 1 0'/>{_LOWER}"
    robot = written_arm(tmp_path, ("0 0 0", _UPPER), ("0 0 -.4", wrist))
    coupled = np.array([[1.0, 0.0], [-sign, 1.0]])
    gears = replace(robot.transmission, topology=coupled)
    coupled_robot, drawn = robot.with_transmission(gears), np.random.default_rng(0)
    waves = drawn.uniform((0.1, 0.5, 0.0), (0.5, 6.0, 6.0), (3, 2, 6, 3))
    time = np.arange(0.0, 20.0, 0.01)
    logs = [moved(coupled_robot, time, own, seed=k) for k, own in enumerate(waves)]
    (finding,) = find_suspicions(logs, robot)[0]
    assert (finding.kind, finding.severity) == ("coupling", "error")
    way = finding.way_out
    text = (tmp_path / "robot.toml").read_text() + way[way.index("[transmission]") :]
    (tmp_path / "robot.toml").write_text(text)
    mended_robot = load_robot(tmp_path / "robot.toml")
    assert mended_robot.transmission.topology == pytest.approx(coupled)
    assert find_suspicions(logs, mended_robot) == [[], [], []]


@pytest.mark.parametrize("size", [200.0, 1000.0])
def test_friction_far_above_the_need_of_a_flange_is_no_other_unit(
    size: float, tmp_path: Path
) -> None:
    """Of a recorded UR10 one wrist alone was said to report N mm, and `wbc init` wrote it."""
    flange = "<inertial pos='0 0 0' mass='.3' fullinertia='2e-4 2e-4 2e-4 0 0 0'/>"
    wrist = f"<joint name='wrist' axis='0 1 0'/>{flange}"
    robot = written_arm(tmp_path, ("0 0 0", _UPPER), ("0 0 -.4", wrist))
    waves = [[(1.0, r, 0.0), (0.4, 2.0 * r, 0.0)] for r in (1.1, 1.7)]
    log = moved(robot, np.arange(0.0, 20.0, 0.01), waves, (0.0, 0.0, 0.0))
    rubs = {}
    for joint, times in (("shoulder", 1.0), ("wrist", size)):
        name, speed = f"{joint}.rotor_torque", log.column(f"{joint}.velocity")
        level = 1.0 if joint == "shoulder" else times * np.std(log.column(name))
        rubs[name] = log.column(name) + level * (np.tanh(speed / 0.02) + speed)
    assert find_suspicions([log.with_columns(rubs)], robot) == [[]]
