"""Every shipped robot loads, and each of its numbers states a unit and where it comes from."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.dynamics import dissipative_equation, evaluate
from wbc.effects import load_robot
from wbc.robot import robot_names, robots_directory

# Total mass [kg] as published or as the description says; None where the source gives none.
MASSES = {
    "planar_leg": 19.0,
    "planar_leg_strong": 19.0,
    "parallelogram_leg": 19.0,
    "solo12": 2.5,
    "anymal": 30.475,
    "talos": 90.27,
    "differential_biped": 10.4494,
}


def numbers(table: dict[str, Any], place: str) -> Iterator[tuple[str, Any]]:
    for joint, gear in table.get("gears", {}).items():
        for key, entry in gear.items():
            if key != "housing":
                yield f"{place}: {joint}.{key}", entry
    for contact in table.get("contacts", []):
        for key in ("offset", "friction"):
            if key in contact:
                yield f"{place}: {contact['name']}.{key}", contact[key]
    for pose, joints in table.get("poses", {}).items():
        for joint, entry in joints.items():
            yield f"{place}: pose {pose}, {joint}", entry
    if "topology" in table.get("transmission", {}):
        yield f"{place}: topology", table["transmission"]["topology"]
    if "gravity" in table:
        yield f"{place}: gravity", table["gravity"]


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
    assert robot.transmission.size >= 1
    q = pin.integrate(robot.model, robot.neutral(), 0.3 * np.ones(robot.model.nv))
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    inertia = dissipative_equation(robot, terms, np.zeros(robot.transmission.size)).inertia
    assert np.linalg.eigvalsh(inertia).min() > 0.0
    assert len(robot.mounting.housing) == robot.transmission.size


@pytest.mark.parametrize("name", sorted(MASSES))
def test_masses(name: str) -> None:
    robot = load_robot(name)
    total = sum(inertia.mass for inertia in robot.model.inertias)
    assert total == pytest.approx(MASSES[name], rel=1e-3)


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


@pytest.mark.parametrize(
    "name", ["planar_leg", "planar_leg_fixed", "planar_leg_strong", "parallelogram_leg"]
)
def test_the_paper_s_pose_has_the_foot_straight_under_the_hip(name: str) -> None:
    robot = load_robot(name)
    foot = evaluate(robot, robot.pose("paper"), np.zeros(robot.model.nv)).contact_position[0]
    ground = -0.8 * np.cos(np.pi / 6) if name == "planar_leg_fixed" else 0.0
    np.testing.assert_allclose(foot, [0.0, 0.0, ground], atol=1e-12)


def test_the_differential_shares_its_motors() -> None:
    robot = load_robot("differential_biped")
    gears = robot.transmission
    roll, pitch = gears.index("left_hip_roll"), gears.index("left_hip_pitch")
    both = np.zeros(10)
    both[[roll, pitch]] = 0.4
    torque = gears.distribution @ both
    np.testing.assert_allclose(torque[pitch], 2 * 6.0 * 0.4)
    np.testing.assert_allclose(np.delete(torque, pitch), 0.0, atol=1e-12)
    both[pitch] = -0.4
    np.testing.assert_allclose((gears.distribution @ both)[[roll, pitch]], [2 * 6.0 * 0.4, 0.0])
