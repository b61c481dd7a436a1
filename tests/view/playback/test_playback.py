"""The page is read back: what it shows is where the robot was, and it asks no network."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbc import load_robot
from wbc.errors import ViewError
from wbc.measurement import Log
from wbc.robot import Robot, bare_robot
from wbc.sim.ground import Plane, Sphere
from wbc.view import write_playback
from wbc.view.channels import configuration, make_track

_MOTION = ("position", "velocity", "acceleration")


def scene_of(page: Path) -> dict:
    text = page.read_text(encoding="utf-8")
    match = re.search(r'<script id="scene" type="application/json">(.*?)</script>', text, re.S)
    return json.loads(match[1])


def floats(text: str, *shape: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(*shape)


@pytest.fixture(scope="module")
def scene(page: Path) -> dict:
    return scene_of(page)


def test_every_frame_holds_the_placement_of_every_joint(
    scene: dict, leg: Robot, squat: Log
) -> None:
    time = floats(scene["time"], -1)
    poses = floats(scene["robot"]["poses"], len(time), leg.model.njoints, 7)
    q = configuration(leg, squat)
    data = leg.model.createData()
    for frame in (0, 40, len(time) - 1):
        row = int(np.argmin(np.abs(squat.time - time[frame])))
        pin.forwardKinematics(leg.model, data, q[row])
        for joint in range(leg.model.njoints):
            place, pose = data.oMi[joint], poses[frame, joint]
            np.testing.assert_allclose(pose[:3], place.translation, atol=1e-6)
            turn = pin.Quaternion(place.rotation).coeffs()
            assert abs(pose[3:] @ turn) == pytest.approx(1.0, abs=1e-6)


def test_the_impact_is_marked_and_its_force_is_not_skipped(scene: dict, squat: Log) -> None:
    labels = [mark["label"].split(",")[0].split(" at")[0] for mark in scene["marks"]]
    assert labels == ["impact of foot", "squat"]
    landing = squat.time[np.argmax(squat.column("foot.force.z") > 0.0)]
    assert scene["marks"][0]["time"] == pytest.approx(landing)
    force = floats(scene["contacts"][0]["force"], -1, 3)
    assert force[:, 2].max() == pytest.approx(squat.column("foot.force.z").max())


def test_power_runs_forward_while_rising_and_backward_while_sinking(scene: dict) -> None:
    time = floats(scene["time"], -1)
    knee = next(gear for gear in scene["gears"] if gear["name"] == "knee")
    mode = floats(knee["direction"], -1)
    # Both link torques act against gravity at the knee only; the squat sinks first.
    sinking, rising = (time > 0.3) & (time < 0.6), (time > 0.8) & (time < 1.2)
    assert set(mode[sinking]) == {-1.0}
    assert set(mode[rising]) == {1.0}


def test_the_page_is_one_file_without_network(page: Path) -> None:
    assert not re.search(r'(src|href)="https?:', page.read_text(encoding="utf-8"))
    assert page.stat().st_size < 2_000_000


def test_a_robot_without_visuals_and_forces_still_plays(tmp_path: Path) -> None:
    robot = bare_robot(pin.buildSampleModelManipulator(), "arm")
    time = np.linspace(0.0, 1.0, 50)
    log = Log(time, {f"{name}.position": np.sin(time) for name in robot.single_joints[:3]})
    scene = scene_of(write_playback(tmp_path / "arm.html", robot, log))
    assert scene["contacts"] == []
    assert scene["floor"] is None
    assert len(scene["commands"]) > 2 * (robot.model.njoints - 1)


def test_a_slope_carries_the_projection_of_the_center_of_mass(
    leg: Robot, squat: Log, tmp_path: Path
) -> None:
    ground = Plane(np.array([-0.3, 0.0, 1.0]), 0.1)
    moved = squat.with_columns({"base_x.position": np.full(len(squat), 0.5)})
    scene = scene_of(write_playback(tmp_path / "slope.html", leg, moved, ground=ground))
    center = floats(scene["com"], -1, 3)
    np.testing.assert_allclose(scene["floor"], 0.1 + 0.3 * center[:, 0], atol=1e-4)
    normal = floats(scene["contacts"][0]["normal"], -1, 3)
    np.testing.assert_allclose(normal[0], [-0.3, 0.0, 1.0] / np.hypot(0.3, 1.0), atol=1e-6)
    with pytest.raises(ViewError, match="no picture of a Sphere"):
        write_playback(tmp_path / "ball.html", leg, squat, ground=Sphere(np.zeros(3), 1.0))


def test_the_camera_frames_all_of_a_motion_that_it_follows(
    leg: Robot, squat: Log, tmp_path: Path
) -> None:
    """It follows over the ground, not upwards: what climbs was cut off by the top of the window."""
    share = squat.time / squat.time[-1]
    moved = {
        "base_x.position": squat.column("base_x.position") + 5.0 * share,
        "base_z.position": squat.column("base_z.position") + 0.3 * share,
    }
    tops, middles = [], []
    for name, log in (("stays", squat), ("climbs", squat.with_columns(moved))):
        scene = scene_of(write_playback(tmp_path / f"{name}.html", leg, log))
        points = np.array(scene["camera"]["points"])
        tops.append(points[:, 2].max())
        middles.append(points[:, 0].mean())
    assert tops[1] > tops[0] + 0.15
    assert abs(middles[1] - middles[0]) < 0.5


def test_a_planned_motion_shows_the_torque_it_needs_its_limit_and_its_path(tmp_path: Path) -> None:
    """Set points without torques were a page with nothing but the moving leg."""
    robot = load_robot("planar_leg_fixed").lossless()
    time = np.linspace(0.0, 2.0, 201)
    columns = {}
    for joint, sign in (("hip", 1.0), ("knee", -1.0)):
        columns[f"{joint}.position"] = sign * (0.5 + 0.2 * np.sin(3.0 * time))
        columns[f"{joint}.velocity"] = sign * 0.6 * np.cos(3.0 * time)
        columns[f"{joint}.acceleration"] = -sign * 1.8 * np.sin(3.0 * time)
    log = Log(time, columns)
    track = make_track(robot, log)
    motion = [np.stack([columns[f"{j}.{w}"] for j in ("hip", "knee")], axis=1) for w in _MOTION]
    data = robot.model.createData()
    links = np.array([pin.rnea(robot.model, data, *row) for row in zip(*motion, strict=True)])
    needed = links + robot.transmission.reflected_inertia * motion[2]
    np.testing.assert_allclose(track.torque, needed[np.searchsorted(time, track.time)], atol=1e-9)
    assert set(track.points) == {"foot"}
    assert np.ptp(track.points["foot"], axis=0).max() > 0.05
    page = write_playback(tmp_path / "plan.html", robot, log).read_text("utf-8")
    assert '"planned":true' in page
    assert '"limit":20.0' in page
    without = {name: values for name, values in columns.items() if "acceleration" not in name}
    assert track.planned
    assert not make_track(robot, Log(time, without)).planned
