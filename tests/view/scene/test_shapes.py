"""Shapes of links and of the ground stand where the robot and the plant have them."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.errors import RobotError
from wbc.robot import Robot
from wbc.robot.body_contacts import placed_geometry
from wbc.robot.coordinates import joint_axis
from wbc.sim.ground import Plane, Stairs, Terrain
from wbc.view.scene import hub_of, scene_size, surface, terrain_slabs
from wbc.view.shapes import along, robot_shapes


def placed(robot: Robot, q: np.ndarray) -> dict[str, np.ndarray]:
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    return {s.name: (data.oMi[s.joint] * s.placement).homogeneous for s in robot_shapes(robot)}


def test_visuals_lie_where_pinocchio_puts_them(leg: Robot) -> None:
    q = leg.configuration(base_x=0.3, base_z=0.7, base_pitch=0.2, hip=0.5, knee=-1.0)
    path = Path(wbc.__file__).parent.parent / "robots" / "planar_leg" / "planar_leg.urdf"
    model = pin.buildModelFromUrdf(str(path))
    geometries = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.VISUAL)
    data, places = model.createData(), geometries.createData()
    pin.updateGeometryPlacements(model, data, geometries, places, q)
    drawn = placed(leg, q)
    assert len(drawn) == 4
    for item, place in zip(geometries.geometryObjects, places.oMg, strict=True):
        np.testing.assert_allclose(drawn[item.name], place.homogeneous, atol=1e-12)


def test_meshes_keep_their_size() -> None:
    try:
        robot = wbc.load_robot("solo12")
    except RobotError as absent:
        pytest.skip(str(absent))
    shapes = robot_shapes(robot)
    assert {s.joint for s in shapes} == set(range(1, robot.model.njoints))
    for shape in shapes:
        vertices = np.asarray(shape.geometry.vertices, dtype=float)
        moved = vertices @ shape.placement.rotation.T + shape.placement.translation
        cell = np.ptp(vertices, axis=0).max() / 20.0
        np.testing.assert_allclose(moved.min(axis=0), shape.low, atol=cell)
        np.testing.assert_allclose(moved.max(axis=0), shape.high, atol=cell)


def seen_of_hub(robot: Robot, joint: str) -> float:
    """Return the share of a joint's disc that no link of the robot covers, in its neutral pose."""
    shapes = robot_shapes(robot)
    hub, axis = hub_of(robot, shapes, joint, scene_size(robot, shapes)), joint_axis(robot, joint)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.neutral())
    place = data.oMi[robot.model.getJointId(joint)] * pin.SE3(along(axis), hub.low * axis)
    angle, share = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 24), [0.0, 0.5, 1.0])
    rim = np.stack([np.cos(angle), np.sin(angle), share * (hub.high - hub.low) / hub.radius], -1)
    bodies = [
        (item.geometry, data.oMi[item.parentJoint] * item.placement)
        for item in placed_geometry(robot, pin.GeometryType.VISUAL)
    ]

    def gap(point: np.ndarray, body: coal.CollisionGeometry, where: pin.SE3) -> float:
        dot = coal.Transform3s(np.eye(3), place.act(hub.radius * point))
        there = coal.Transform3s(where.rotation, where.translation)
        asked, answer = coal.DistanceRequest(), coal.DistanceResult()
        return coal.distance(coal.Sphere(1e-5), dot, body, there, asked, answer)

    free = [all(gap(point, *body) > 0.0 for body in bodies) for point in rim.reshape(-1, 3)]
    return float(np.mean(free))


def test_no_link_hides_the_disc_of_a_joint() -> None:
    """The discs of the TX40 lay within its links, which are as thick as they are long."""
    for name in ("staubli_tx40", "planar_leg_fixed", "double_pendulum"):
        robot = wbc.load_robot(name)
        seen = {joint: seen_of_hub(robot, joint) for joint in robot.transmission.joints}
        assert min(seen.values()) > 0.25, seen


def test_discs_of_parallel_joints_at_one_place_keep_apart() -> None:
    """The first and the last joint of a stretched wrist turn about one line."""
    robot = wbc.load_robot("staubli_tx40")
    shapes = robot_shapes(robot)
    size = scene_size(robot, shapes)
    first, last = (hub_of(robot, shapes, f"joint_{k}", size) for k in (4, 6))
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.neutral())
    lines = [data.oMi[k].rotation @ joint_axis(robot, f"joint_{k}") for k in (4, 6)]
    sign = float(np.round(lines[0] @ lines[1]))
    assert abs(sign) == 1.0
    spans = sorted([(first.low, first.high), tuple(sorted((sign * last.low, sign * last.high)))])
    assert spans[0][1] < spans[1][0]


STAIRS = Stairs(np.array([-5.0, 0.1, 0.4]), np.array([9.0, 0.0, 0.1, 0.25]))
TILTED = Plane(np.array([0.1, -0.2, 1.0]), -0.2)


@pytest.mark.parametrize(
    "terrain", [Plane(), Plane(height=0.3), Plane.slope(0.25, 0.1), TILTED, STAIRS]
)
def test_points_on_the_drawn_surface_touch_the_ground(terrain: Terrain) -> None:
    center, rng = np.array([0.2, 0.1, 0.6]), np.random.default_rng(0)
    for slab in terrain_slabs(terrain, center, 2.0):
        for x, y in 0.5 * slab.sides[:2] * rng.uniform(-0.9, 0.9, (20, 2)):
            point = slab.placement.act(np.array([x, y, 0.5 * slab.sides[2] + 1e-9]))
            gap, normal = terrain.gap(point[None])
            assert gap[0] == pytest.approx(0.0, abs=1e-8)
            np.testing.assert_allclose(slab.placement.rotation[:, 2], normal[0], atol=1e-12)
    points = center + rng.uniform(-0.8, 0.8, (40, 3))
    points[:, 2] = surface(terrain, points)[0]
    np.testing.assert_allclose(terrain.gap(points)[0], 0.0, atol=1e-8)
