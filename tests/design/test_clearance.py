"""Planned motions in which no two links meet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from wbc.design.experiment import (
    MotionLimits,
    Rivals,
    design_experiment,
    parse_cause,
    random_paths,
)
from wbc.design.experiment.motions import LinkDistances
from wbc.effects import load_robot
from wbc.robot import Robot

_WALL, _HALF = np.array([0.25, 0.0, -0.6]), np.array([0.02, 0.2, 0.4])
_LINK = """<inertial><origin xyz="0 0 -0.15"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.15"/><geometry><cylinder radius="0.02" length="0.26"/></geometry>
</collision>"""
_JOINT = """<parent link="{}"/><child link="{}"/><origin xyz="0 0 {}"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="20"/>"""
_GEAR = """
[gears.{}]
gear_ratio = {{ value = 10.0, unit = "1", source = "assumed" }}
rotor_inertia = {{ value = 1e-5, unit = "kg m^2", source = "assumed" }}
forward_efficiency = {{ value = 1.0, unit = "1", source = "assumed" }}
torque_limit = {{ value = 5.0, unit = "N m", source = "assumed" }}
"""
_ROBOT = 'name = "walled"\nmodel = "walled.urdf"\nbase = "fixed"\n'
_ROBOT += _GEAR.format("shoulder") + _GEAR.format("elbow")


def walled(folder: Path) -> Robot:
    """Return an arm of two links that hangs beside a wall."""
    wall = f"""<collision><origin xyz="{" ".join(map(str, _WALL))}"/><geometry>
    <box size="{" ".join(str(2.0 * x) for x in _HALF)}"/></geometry></collision>"""
    (folder / "walled.urdf").write_text(
        f"""<robot name="walled"><link name="base">{wall}</link>
        <link name="upper">{_LINK}</link><link name="lower">{_LINK}</link>
        <joint name="shoulder" type="revolute">{_JOINT.format("base", "upper", 0)}</joint>
        <joint name="elbow" type="revolute">{_JOINT.format("upper", "lower", -0.3)}</joint>
        </robot>"""
    )
    path = folder / "robot.toml"
    path.write_text(_ROBOT)
    return load_robot(str(path))


def distance_to_wall(robot: Robot, positions: np.ndarray) -> float:
    """Return how near the lower link comes to the wall [m], by kinematics of its own."""
    box, rod = coal.Box(*(2.0 * _HALF)), coal.Cylinder(0.02, 0.26)
    least, still = np.inf, coal.Transform3s(np.eye(3), _WALL)
    for one, two in positions:
        elbow = 0.3 * np.array([-np.sin(one), 0.0, -np.cos(one)])
        turn = pin.utils.rotate("y", one + two)
        here = coal.Transform3s(turn, elbow + turn @ np.array([0.0, 0.0, -0.15]))
        found = coal.DistanceResult()
        least = min(least, coal.distance(box, still, rod, here, coal.DistanceRequest(), found))
    return float(least)


def test_no_link_meets_another_along_a_designed_motion(tmp_path: Path) -> None:
    robot = walled(tmp_path)
    causes = ("rotor_inertia@elbow", "payload_mass@lower")
    rivals = Rivals(robot, tuple(parse_cause(c, robot) for c in causes), np.full(2, 0.01))
    limits = MotionLimits.of(robot, span=2.0, speed=6.0)
    blind = replace(limits, clearance=None)
    fine = np.linspace(0.0, 4.0, 1601)
    wild = [p.at(fine)[0] for p in random_paths(rivals, blind, 4.0, 1, 4)]
    assert min(distance_to_wall(robot, q) for q in wild) < 0.0  # without the limit they hit it
    found = design_experiment(rivals, limits, 4.0, rounds=10)
    q = found.path.at(fine)[0]
    near = distance_to_wall(robot, q)
    assert near > 0.015  # 20 mm at the samples of the search, a little less between them
    assert limits.clearance is not None
    assert limits.clearance.least(q[::40]) >= near - 1e-9
    assert found.worst > 0.0


def test_a_robot_without_solids_has_no_clearance() -> None:
    assert MotionLimits.of(load_robot("planar_leg_fixed")).clearance is None


def test_a_row_touches_whatever_stands_in_the_rows_before_it() -> None:
    """A whole motion keeps apart just where each of its rows, judged alone, does."""
    robot = load_robot("solo12").lossless()
    found = LinkDistances.of(robot, center := robot.pose()[robot.actuated_position])
    assert found is not None
    random, time = np.random.default_rng(0), np.arange(300) / 50.0
    phase = random.uniform(0.0, 6.0, (len(center), 3))
    waves = [
        np.sin(0.6 * np.pi * (k + 1) * time[:, None] + phase[:, k]) for k in range(phase.shape[1])
    ]
    rows = center + 0.4 * sum(waves)
    apart = np.array([found.least(row[None]) >= found.margin for row in rows])
    assert 50 < apart.sum() < 280
    free = rows[apart]
    assert found.keeps(free)
    for row in rows[~apart]:
        assert not found.keeps(np.vstack([free[:20], row]))
