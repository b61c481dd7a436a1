"""Robots: names, poses, copies, endless joints; shipped ones say where their numbers are from."""

import copy
import pickle
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.dynamics import dissipative_equation, evaluate
from wbc.effects import CoulombFriction, load_robot, save_robot
from wbc.errors import RobotError, TransmissionError
from wbc.identification import compare
from wbc.measurement import Log
from wbc.robot import Robot, bare_robot, robot_names, robots_directory
from wbc.sim.servo_rollout import DcDrive, winding_current
from wbc.transmission import Transmission

# Total mass [kg] as published or as the description says, where there is such a number.
MASSES = {
    "planar_leg": 19.0,
    "planar_leg_strong": 19.0,
    "parallelogram_leg": 19.0,
    "solo12": 2.5,
    "anymal": 30.475,
    "talos": 90.27,
    "differential_biped": 10.4494,
}


def with_armature() -> pin.Model:
    model = load_robot("planar_leg_fixed").model.copy()
    model.armature = np.array([0.1, 0.0])
    return model


LEG, SOLO = load_robot("planar_leg"), load_robot("solo12")
BARE = bare_robot(LEG.model)
MISTAKES: list[tuple[str, Callable[[], object]]] = [
    ("Did you mean 'knee'", lambda: LEG.configuration(knie=1.0)),
    ("Did you mean 'knee'", lambda: LEG.velocity_index("knie")),
    ("There are: foot", lambda: LEG.contact("toe")),
    ("thigh", lambda: LEG.body_joint("thig")),
    ("count twice", lambda: bare_robot(with_armature())),
    ("6 degrees of", lambda: Robot("x", SOLO.model, Transmission(("root_joint",), [1], [0]))),
    (r"There are: \(none\)", lambda: BARE.transmission.index("hip")),
    (r"There are: \(none\)", BARE.pose),
    ("There are: half_sitting", lambda: load_robot("talos").pose("sitting")),
    ("supply_voltage", lambda: DcDrive(0.0)),
    ("source_resistance", lambda: DcDrive(5.0, source_resistance=-0.1)),
    ("current_limit", lambda: DcDrive(5.0, current_limit=0.0)),
    ("duty_limit", lambda: DcDrive(5.0, duty_limit=1.2)),
]


@pytest.mark.parametrize(("message", "ask"), MISTAKES)
def test_what_there_is_not_is_named(message: str, ask: Callable[[], object]) -> None:
    with pytest.raises((RobotError, TransmissionError), match=message):
        ask()


@pytest.mark.parametrize("how", [copy.deepcopy, copy.copy, lambda r: pickle.loads(pickle.dumps(r))])
@pytest.mark.parametrize("name", ["solo12", "parallelogram_leg", "emps", "talos"])
def test_a_copy_is_the_robot(name, how):
    robot = load_robot(name)
    robot = robot.with_effect(CoulombFriction(robot.transmission.joints[0], level=0.1))
    found = how(robot)
    q, v = robot.neutral(), np.ones(robot.model.nv)
    one, two = (pin.rnea(r.model, r.model.createData(), q, v, v).copy() for r in (robot, found))
    np.testing.assert_array_equal(one, two)
    assert (found.joints, found.effects) == (robot.joints, robot.effects)
    assert [c.name for c in found.contacts] == [c.name for c in robot.contacts]
    assert list(found.poses) == list(robot.poses)
    arrays = [*found.poses.values(), *(contact.offset for contact in found.contacts)]
    for array in (found.transmission.gear_ratio, found.actuated, *arrays):
        assert not array.flags.writeable
    assert found.source == robot.source


TEXT = """
model = "{folder}/planar_leg/planar_leg.urdf"
[poses.crouch]
base_z = {{ value = 500.0, unit = "mm" }}
knee = {{ value = 90.0, unit = "deg" }}
[poses.tall]
"""


def test_poses_are_named_in_order_with_units(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(TEXT.format(folder=robots_directory().as_posix()))
    robot = load_robot(path)
    np.testing.assert_allclose(robot.pose("crouch"), [0.0, 0.5, 0.0, 0.0, np.pi / 2])
    np.testing.assert_array_equal(robot.pose("tall"), np.zeros(5))
    np.testing.assert_array_equal(robot.pose(), robot.pose("crouch"))
    robot.pose()[0] = 1.0
    assert robot.pose()[0] == 0.0


LINK = """<link name="{}"><inertial><origin xyz="0 0 -0.4"/><mass value="0.6"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""
JOINT = """<joint name="swing" type="continuous"><parent link="base"/><child link="rod"/>
<axis xyz="0 1 0"/>{}</joint>"""
SWING = """
name = "r"
model = "r.urdf"
base = "{}"
[gears.swing]
gear_ratio = 6.0
rotor_inertia = 6e-5
"""


@pytest.mark.parametrize("limit", ["", '<limit effort="5" velocity="8"/>'])
@pytest.mark.parametrize("base", ["fixed", "free_flyer"])
def test_a_continuous_joint_counts_its_turns(tmp_path, limit, base) -> None:
    text = f'<robot name="r">{LINK.format("base")}{LINK.format("rod")}{JOINT.format(limit)}</robot>'
    (tmp_path / "r.urdf").write_text(text)
    (tmp_path / "robot.toml").write_text(SWING.format(base))
    robot = load_robot(str(tmp_path / "robot.toml"))
    assert robot.single_joints == ("swing",)
    row = robot.position_index("swing")
    assert robot.model.upperPositionLimit[row] == np.inf
    if base == "free_flyer":
        return
    time = np.arange(0.0, 8.0, 0.005)
    angle = 2.0 * np.pi * (1.0 - np.cos(0.8 * time))  # two turns and back
    rate = np.gradient(np.gradient(angle, time), time)
    moment = 0.01 + 0.6 * 0.4**2 + 6e-5 * 6.0**2
    torque = moment * rate + 0.6 * 9.81 * 0.4 * np.sin(angle)
    log = Log(time, {"swing.position": angle, "swing.motor_torque": torque})
    found = compare(robot, [log]).outputs[0]
    assert found.rms < 0.02 * found.size


def test_mean_voltage_balances_around_the_winding() -> None:
    duty, back_emf, resistance = 0.6, 2.0, 3.0
    current = winding_current(duty, back_emf, resistance, 12.0, 0.5, np.inf)
    assert duty * (12.0 - 0.5 * current) == pytest.approx(resistance * current + back_emf)
    limited = [winding_current(duty, 0.0, 2.0, 12.0, 0.0, 1.0) for duty in (1.0, -1.0)]
    assert limited == pytest.approx([1.0, -1.0])


def numbers(table: dict[str, Any] | list[Any], place: str) -> Iterator[tuple[str, Any]]:
    """Yield every entry of tables and lists that is a number, or says to have a value."""
    for key, entry in table.items() if isinstance(table, dict) else enumerate(table):
        if isinstance(entry, dict | list) and "value" not in entry:
            yield from numbers(entry, f"{place}: {key}")
        elif not isinstance(entry, bool | str):
            yield f"{place}: {key}", entry


@pytest.mark.parametrize("name", robot_names())
def test_every_number_has_a_unit_and_a_source(name: str) -> None:
    table = tomllib.loads((robots_directory() / name / "robot.toml").read_text(encoding="utf-8"))
    for place, entry in numbers(table, name):
        assert isinstance(entry, dict), f"{place} is a bare number"
        assert entry.get("unit"), f"{place} has no unit"
        assert len(entry.get("source", "")) >= len("assumed"), f"{place} has no source"


@pytest.mark.parametrize("name", robot_names())
def test_every_robot_loads_and_moves(name: str) -> None:
    robot = load_robot(name)
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    assert mass == pytest.approx(MASSES.get(name, mass), rel=1e-3)
    assert robot.transmission.size >= 1
    q = pin.integrate(robot.model, robot.neutral(), 0.3 * np.ones(robot.model.nv))
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    inertia = dissipative_equation(robot, terms, np.zeros(robot.transmission.size)).inertia
    assert np.linalg.eigvalsh(inertia).min() > 0.0
    assert len(robot.mounting.housing) == robot.transmission.size


@pytest.mark.parametrize("name", ["solo12", "anymal", "talos", "differential_biped"])
def test_the_usual_pose_stands_on_the_ground_within_its_feet(name: str) -> None:
    robot = load_robot(name)
    q = robot.pose()
    points = evaluate(robot, q, np.zeros(robot.model.nv)).contact_position
    np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-6)
    above = pin.centerOfMass(robot.model, robot.model.createData(), q)[:2]
    assert np.all(points[:, :2].min(axis=0) < above)
    assert np.all(above < points[:, :2].max(axis=0))
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    inside = (q >= lower - 1e-9) & (q <= upper + 1e-9)
    assert inside[robot.actuated_position].all()


def test_other_balls_at_contacts_are_not_lost_in_a_file(tmp_path: Path) -> None:
    """A saved robot had the radius of the file that it refers to."""
    robot = load_robot("solo12")
    balls = [replace(contact, radius=0.016) for contact in robot.contacts]
    assert [c.radius for c in robot.with_contacts(balls).contacts] == 4 * [0.016]
    with pytest.raises(RobotError, match="changed in code"):
        save_robot(robot.with_contacts(balls), tmp_path / "balls.toml")
    with pytest.raises(RobotError, match=r"keeps its contacts \(FL_foot, .*their order"):
        robot.with_contacts(balls[::-1])
