"""Set points of planned motions, held against every limit by formulas of the tests' own.

The file that the command wrote is read on a grid ten times as dense as the search's. Velocities
and accelerations are differences of the positions; torques come from the links and rotors with each
cause in them, distances from the solids of the URDF. Beside a wall no two links meet.
"""

import json
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from tests.design.rivals import rivals
from wbc.cli import main
from wbc.design.experiment import MotionLimits, design_experiment, random_paths
from wbc.design.experiment.motions import LinkDistances
from wbc.effects import load_robot
from wbc.robot import Robot
from wbc.robot.body_contacts import collision_solids

RATE, DURATION = 400, 1.5
SPAN, SPEED, ACCELERATION = 0.8, 3.0, 40.0
# Of the leg, of Solo12 in a stand, of a six-axis arm: joint with a heavier rotor, link with a load.
ROBOTS = {
    "planar_leg_fixed": ("knee", "shin"),
    "solo12": ("FL_KFE", "FL_LOWER_LEG"),
    "staubli_tx40": ("joint_3", "link_3"),
}
ROTOR, LOAD = 0.01, 0.1  # reflected inertia [kg m^2], mass [kg]
KEPT = 0.81  # share of a limit: the search keeps 0.8 on its coarse grid


@pytest.fixture(scope="module", params=list(ROBOTS))
def planned(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """The robot and its set points: times (N,), and (3, N, m) of the driven joints.

    What the command says is held here: which stand it needs, and odds above those of chance.
    """
    name, out = request.param, tmp_path_factory.mktemp("planned") / "set points.csv"
    odds = out.with_name("odds.json")
    joint, link = ROBOTS[name]
    heavy = f"rotor_inertia@{joint}:reflected_inertia={ROTOR}"
    load = f"payload_mass@{link}:mass={LOAD}"
    options = f"--lossless --span {SPAN} --speed {SPEED} --acceleration {ACCELERATION} --rounds 1"
    options += f" --rate {RATE} --duration {DURATION} --noise 0.05"
    files = ["--out", str(out), "--json", str(odds)]
    with pytest.MonkeyPatch.context() as quicker, redirect_stdout(StringIO()) as shown:
        for draws, count in (("_RANDOM", 3), ("_DRAWN", 8)):
            quicker.setattr(f"wbc.design.experiment.search.{draws}", count)
        assert main(["experiment", name, *options.split(), *files, "--between", heavy, load]) == 0
    assert ("hold the base in a stand" in shown.getvalue()) == (name == "solo12")
    said = json.loads(odds.read_text())["log10_odds"]
    least = {way: min(pair["value"] for pair in pairs) for way, pairs in said.items()}
    assert least["designed"] > least["random, median"] > 0.0
    heads = out.read_text().split("\n", 1)[0].split(",")
    table = np.loadtxt(out, delimiter=",", skiprows=1)
    robot = load_robot(name).lossless()
    assert heads == ["time"] + [
        f"{j}.{what}" for j in robot.transmission.joints
        for what in ("position", "velocity", "acceleration")
    ]  # fmt: skip
    return robot, table[:, 0], np.stack([table[:, k::3] for k in (1, 2, 3)])


def test_set_points_come_at_the_stated_rate_and_are_one_motion(planned) -> None:
    _, time, (q, v, a) = planned
    np.testing.assert_allclose(time, np.arange(round(DURATION * RATE) + 1) / RATE, atol=1e-9)
    np.testing.assert_allclose((q[2:] - q[:-2]) * 0.5 * RATE, v[1:-1], atol=5e-3 * SPEED)
    # The jerk jumps where the window is open, after a tenth of the time and before the last tenth.
    open_ = np.minimum(np.abs(time - 0.1 * DURATION), np.abs(time - 0.9 * DURATION)) < 2.0 / RATE
    bend = ((v[2:] - v[:-2]) * 0.5 * RATE - a[1:-1])[~open_[1:-1]]
    np.testing.assert_allclose(bend, 0.0, atol=5e-3 * ACCELERATION)
    np.testing.assert_allclose([v[0], v[-1], a[0], a[-1]], 0.0, atol=1e-6)
    assert np.ptp(q, axis=0).max() > 0.1


def test_positions_speeds_and_accelerations_keep_their_limits(planned) -> None:
    robot, _, (q, _, _) = planned
    center, rows = q[0], robot.actuated_position
    low, high = robot.model.lowerPositionLimit[rows], robot.model.upperPositionLimit[rows]
    low = np.maximum(np.where(high > low, low, -np.inf), center - SPAN)
    high = np.minimum(np.where(high > low, high, np.inf), center + SPAN)
    speed = np.where(robot.model.velocityLimit > 0.0, robot.model.velocityLimit, np.inf)
    fastest = np.minimum(speed[robot.actuated], SPEED)
    assert np.all(q <= center + KEPT * (high - center))
    assert np.all(q >= center + KEPT * (low - center))
    assert np.all(np.abs(np.diff(q, axis=0)) * RATE <= KEPT * fastest)
    # Positions have nine digits: a second difference is uncertain by 4e-9 RATE^2.
    bend = np.abs(np.diff(q, n=2, axis=0)) * RATE**2
    assert np.all(bend <= KEPT * ACCELERATION + 4e-9 * RATE**2)
    shares = [np.abs(q - center) / np.minimum(high - center, center - low), bend / ACCELERATION]
    shares.append(torques(robot, planned[2]) / robot.transmission.torque_limit)
    shares.append(np.abs(np.diff(q, axis=0)) * RATE / fastest)
    assert max(share.max() for share in shares) > 0.5  # a limit is used, not only kept


def torques(robot: Robot, motion: np.ndarray) -> np.ndarray:
    """Return the largest rotor torque (N, m) [N m] with no cause, the rotor or the load."""
    joint, link = ROBOTS[robot.name]
    gears, model, at = robot.transmission, robot.model, robot.body_joint(link)
    # A load sits at the link's centre of mass.
    load = pin.Inertia(LOAD, model.inertias[at].lever, np.zeros((3, 3)))
    loaded = robot.with_inertia(at, model.inertias[at] + load).model
    known, heavy = np.array(gears.reflected_inertia), np.array(gears.reflected_inertia)
    heavy[gears.joints.index(joint)] = ROTOR
    peak, pose = np.zeros(motion.shape[1:]), robot.pose() if robot.poses else robot.neutral()
    for which, reflected in ((model, known), (model, heavy), (loaded, known)):
        data = which.createData()
        for row, (q, v, a) in enumerate(zip(*motion, strict=True)):
            whole, (rate, rise) = pose.copy(), np.zeros((2, model.nv))
            whole[robot.actuated_position] = q
            rate[robot.actuated], rise[robot.actuated] = v, a
            needed = pin.rnea(which, data, whole, rate, rise)[robot.actuated] + reflected * a
            peak[row] = np.maximum(peak[row], np.abs(needed / gears.gear_ratio))
    return peak


def test_rotor_torques_keep_their_limits_whichever_cause_is_true(planned) -> None:
    robot, _, motion = planned
    assert np.all(torques(robot, motion) <= KEPT * robot.transmission.torque_limit)


def test_links_that_no_joint_joins_keep_apart(planned) -> None:
    robot, _, (q, _, _) = planned
    solids = collision_solids(robot)
    parents, objects = robot.model.parents, solids.geometryObjects
    pairs = [
        (i, k)
        for i, one in enumerate(objects)
        for k, two in enumerate(objects[:i])
        if one.parentJoint not in (two.parentJoint, parents[two.parentJoint])
        and two.parentJoint != parents[one.parentJoint]
    ]
    if not pairs:
        assert robot.name != "solo12"
        return
    for i, k in pairs:
        solids.addCollisionPair(pin.CollisionPair(i, k))

    def distances(row: np.ndarray) -> np.ndarray:
        data, near, whole = robot.model.createData(), solids.createData(), robot.pose()
        whole[robot.actuated_position] = row
        pin.computeDistances(robot.model, data, solids, near, whole)
        return np.array([one.min_distance for one in near.distanceResults])

    apart = distances(q[0]) >= 0.02
    assert apart.sum() > 50
    assert min(distances(row)[apart].min() for row in q[::10]) >= 0.0199


_WALL, _HALF = np.array([0.25, 0.0, -0.6]), np.array([0.02, 0.2, 0.4])
_LINK = """<inertial><origin xyz="0 0 -0.15"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.15"/><geometry><cylinder radius="0.02" length="0.26"/></geometry>
</collision>"""
_JOINT = """<parent link="{}"/><child link="{}"/><origin xyz="0 0 {}"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="20"/>"""
_ROBOT = """
name = "walled"
model = "walled.urdf"
base = "fixed"
[gears."*"]
gear_ratio = 10.0
rotor_inertia = 1e-5
torque_limit = 5.0
"""


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
    (folder / "robot.toml").write_text(_ROBOT)
    return load_robot(folder)


def distance_to_wall(robot: Robot, positions: np.ndarray) -> float:
    """Return how near the lower link comes to the wall [m], by kinematics of its own."""
    box, rod = coal.Box(*(2.0 * _HALF)), coal.Cylinder(0.02, 0.26)
    least, still, asked = np.inf, coal.Transform3s(np.eye(3), _WALL), coal.DistanceRequest()
    for one, two in positions:
        elbow = 0.3 * np.array([-np.sin(one), 0.0, -np.cos(one)])
        turn = pin.utils.rotate("y", one + two)
        here = coal.Transform3s(turn, elbow - 0.15 * turn[:, 2])
        least = min(least, coal.distance(box, still, rod, here, asked, coal.DistanceResult()))
    return float(least)


def test_no_link_meets_another_along_a_designed_motion(tmp_path: Path) -> None:
    robot = walled(tmp_path)
    chosen = rivals("rotor_inertia@elbow", "payload_mass@lower", robot=robot)
    limits = MotionLimits.of(robot, span=2.0, speed=6.0)
    blind = replace(limits, clearance=None)
    fine = np.linspace(0.0, 4.0, 1601)
    wild = [p.at(fine)[0] for p in random_paths(chosen, blind, 4.0, 1, 4)]
    assert min(distance_to_wall(robot, q) for q in wild) < 0.0  # without the limit they hit it
    found = design_experiment(chosen, limits, 4.0, rounds=10)
    q = found.path.at(fine)[0]
    near = distance_to_wall(robot, q)
    assert near > 0.015  # 20 mm at the samples of the search, a little less between them
    assert found.worst > 0.0


def test_a_row_touches_whatever_stands_in_the_rows_before_it() -> None:
    """A whole motion keeps apart just where each of its rows, judged alone, does."""
    robot = load_robot("solo12").lossless()
    found = LinkDistances(robot, center := robot.pose()[robot.actuated_position])
    random, time = np.random.default_rng(0), np.arange(300) / 50.0
    phase = random.uniform(0.0, 6.0, (len(center), 3))
    beats = 0.6 * np.pi * np.arange(1, 4)
    rows = center + 0.4 * np.sin(time[:, None, None] * beats + phase).sum(axis=2)
    apart = np.array([found.keeps(row[None]) for row in rows])
    assert 50 < apart.sum() < 280
    free = rows[apart]
    assert found.keeps(free)
    for row in rows[~apart]:
        assert not found.keeps(np.vstack([free[:20], row]))
