"""The bodies of a scene, built once, which a playback moves; and the slabs of its ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import ViewError
from wbc.robot import Robot
from wbc.robot.coordinates import joint_axis
from wbc.sim.ground import Plane, Stairs, Terrain
from wbc.view.palette import GREEN, GREY, PURPLE, YELLOW
from wbc.view.shapes import LinkShape, UprightCylinder, along

ARROW_HEAD = 0.055
"""Length of the head of a force arrow, of the robot's size."""
# Radius of a pin over half the thickness of its link: the link still shows around it.
_PIN = 0.6


# Of the robot's size, how far from a joint a mesh still decides about its disc: whole links of
# TALOS asked for discs that hid the robot.
_NEAR = 0.07


def scene_size(robot: Robot, shapes: tuple[LinkShape, ...]) -> float:
    """Return about the size [m] of a robot in its neutral pose: arrows, hubs and marks fit it."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.neutral())
    corners = [data.oMi[one.joint].act(end) for one in shapes for end in (one.low, one.high)]
    return max(float(np.ptp(corners, axis=0).max()), 1e-3) if corners else 1.0


class Hub(NamedTuple):
    """The disc on a joint: from `low` to `high` along the joint's axis, with a radius [m]."""

    low: float
    high: float
    radius: float


def hub_of(robot: Robot, shapes: tuple[LinkShape, ...], joint: str, reach: float) -> Hub:
    """Return a disc that sticks out of the bodies around a joint.

    A pin through them where they reach no farther along the axis than the moved link does across
    it; else a ring around that link, on the side to which they reach farther, so that the rings of
    a wrist keep apart.
    """
    number, axis = robot.model.getJointId(joint), joint_axis(robot, joint)
    slim, margin = 0.034 * reach, 0.012 * reach
    places = number, int(robot.model.parents[number])
    frames = pin.SE3.Identity(), robot.model.jointPlacements[number].inverse()
    own, other = (
        [box for s in shapes if s.joint == n and (box := _box(s, place, _NEAR * reach)).size]
        for n, place in zip(places, frames, strict=True)
    )
    touching = [b for b in own + other if (b[0] <= margin).all() and (b[1] >= -margin).all()]
    if not touching:
        return Hub(-margin, margin, slim)
    k = int(np.argmax(np.abs(axis)))
    ends = np.sign(axis[k]) * np.array([box[:, k] for box in touching])
    low, high = float(ends.min()), float(ends.max())
    sides = np.array([np.delete(np.abs(box).max(axis=0), k) for box in own or other])
    across, thick = float(sides.max()), float(sides.min(axis=1).max())
    if max(-low, high) <= across + margin:
        return Hub(low - margin, high + margin, max(slim, min(_PIN * thick, 2.0 * slim)))
    middle = slim if high >= -low else -slim
    return Hub(middle - 0.5 * slim, middle + 0.5 * slim, across + margin)


def _box(shape: LinkShape, place: pin.SE3, near: float) -> FloatArray:
    """Return the lower and upper corner (2, 3) [m] of a body's box in another frame.

    Of a mesh only what is `near` [m] the frame's origin counts; (0,) if nothing is.
    """
    points, mesh = shape.corners, getattr(shape.geometry, "vertices", None)
    if mesh is not None:
        points, place = np.asarray(mesh, dtype=np.float64), place * shape.placement
    points = points @ place.rotation.T + place.translation
    if mesh is not None:
        points = points[np.linalg.norm(points, axis=1) < near]
    return np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else points


_THICKNESS = 0.02  # [m] of a slab of the ground


class GroundSlab:
    """A thin box whose upper face is walked on.

    Attributes:
        placement: of the middle of the box, world.
        sides: (3,) [m] lengths.
    """

    def __init__(self, turn: FloatArray, face: list[float], length: float, width: float) -> None:
        """Place the middle of the upper face at `face`; z of `turn` is its normal."""
        self.placement = pin.SE3(turn, np.asarray(face) - 0.5 * _THICKNESS * turn[:, 2])
        self.sides = np.array([length, width, _THICKNESS])


def surface(terrain: Terrain | None, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return heights (k,) [m] and unit normals (k, 3) of the ground below or above points (k, 3).

    Without a ground they are zero and vertical. Nobody stands on a riser.

    Raises:
        ViewError: a kind of terrain that has no picture yet.
    """
    normal = np.array([0.0, 0.0, 1.0])
    match terrain := terrain or Plane():
        case Plane():
            normal = np.asarray(terrain.normal)
            heights = terrain.height - points[:, :2] @ normal[:2] / normal[2]
        case Stairs():
            heights = terrain.heights[np.searchsorted(terrain.edges, points[:, 0])]
        case _:
            way = "give a Plane or Stairs to stand on."
            raise ViewError(f"no picture of a {type(terrain).__name__}; {way}")
    return heights, np.tile(normal, (len(points), 1))


def terrain_slabs(
    terrain: Terrain | None, center: FloatArray, size: float
) -> tuple[GroundSlab, ...]:
    """Return the slabs of a terrain within a square of `size` [m] around x, y of `center`.

    Raises:
        ViewError: a kind of terrain that has no picture yet.
    """
    if terrain is None:
        return ()
    if not isinstance(terrain, Stairs):
        heights, normals = surface(terrain, center[None])
        return (GroundSlab(along(normals[0]), [*center[:2], heights[0]], size, size),)
    low, high = center[0] - 0.5 * size, center[0] + 0.5 * size
    ends = [low, *(x for x in terrain.edges.tolist() if low < x < high), high]
    middles = [0.5 * (a + b) for a, b in pairwise(ends)]
    heights, _ = surface(terrain, np.array(middles)[:, None])
    steps = zip(middles, heights, np.diff(ends), strict=True)
    slabs = [GroundSlab(np.eye(3), [x, 0.0, z], width, size) for x, z, width in steps]
    for x, (below, above) in zip(ends[1:-1], pairwise(heights), strict=True):
        if below != above:  # a riser, which faces the lower side
            turn = np.asarray(pin.utils.rotate("y", -0.5 * np.pi * np.sign(above - below)))
            middle = [x, 0.0, 0.5 * (below + above)]
            slabs.append(GroundSlab(turn, middle, abs(above - below), size))
    return tuple(slabs)


def add_paths(root: Any, paths: Mapping[str, FloatArray]) -> None:
    """Add the path (F, 3) [m] of every contact point as a line."""
    for name, points in paths.items():
        corners = mg.PointsGeometry(np.ascontiguousarray(points.T, dtype=np.float32))
        root[name].set_object(mg.Line(corners, mg.LineBasicMaterial(color=int(PURPLE[1:], 16))))


def add_ground(root: Any, ground: Terrain | None, center: FloatArray, opacity: float) -> None:
    """Add the ground under the path (F, 3) [m] of a centre of mass, of an opacity in [0, 1]."""
    middle = 0.5 * (center.min(axis=0) + center.max(axis=0))
    slabs = terrain_slabs(ground, middle, float(np.ptp(center, axis=0).max()) + 2.5)
    look = {"color": 0xA9B0BA, "opacity": opacity, "transparent": opacity < 1.0}
    for i, slab in enumerate(slabs):
        root[f"slab{i}"].set_object(mg.Box(slab.sides.tolist()), mg.MeshLambertMaterial(**look))
        root[f"slab{i}"].set_transform(slab.placement.homogeneous)


def add_robot_scene(
    viewer: Any, robot: Robot, shapes: tuple[LinkShape, ...], contacts: Sequence[str]
) -> float:
    """Add robot, hubs, named contacts and centre of mass; return the robot's size [m].

    Args:
        viewer: where to add them: the bodies of each joint at `robot/j<number>` with a disc on its
            axis at `hub`, to be coloured; an arrow of unit length along z and a friction cone at
            `contacts/<name>`, to be placed and scaled; a ball, its shadow and a line at `com`.
        robot: whose joints and contacts.
        shapes: its bodies, from `robot_shapes`.
        contacts: names of those with an arrow and a cone.
    """
    reach = scene_size(robot, shapes)
    for shape in shapes:
        place = viewer["robot"][f"j{shape.joint}"][shape.name]
        _put(place, shape.geometry, shape.colour, shape.placement.homogeneous)
    for joint in robot.transmission.joints:
        number, axis = robot.model.getJointId(joint), joint_axis(robot, joint)
        hub = hub_of(robot, shapes, joint, reach)
        body = UprightCylinder(hub.high - hub.low, hub.radius)
        place = pin.SE3(along(axis), 0.5 * (hub.low + hub.high) * axis).homogeneous
        _put(viewer["robot"][f"j{number}"]["hub"], body, GREY, place)
    for name in contacts:
        _add_contact(viewer["contacts"][name], robot.contact(name).friction, reach)
    ball, radius = viewer["com"], 0.028 * reach
    ball["ball"].set_object(mg.Sphere(radius), material(PURPLE, 1.0))
    ball["floor"].set_object(UprightCylinder(0.004 * reach, radius), material(PURPLE, 0.9))
    _put(ball["line"]["body"], UprightCylinder(1.0, 0.12 * radius), PURPLE, _shift(0.5), 0.8)
    return reach


def _add_contact(root: Any, friction: float, reach: float) -> None:
    """Add an arrow of unit length along z and a friction cone, to be placed and scaled."""
    radius, head, height = 0.011 * reach, ARROW_HEAD * reach, 0.28 * reach
    _put(root["shaft"]["body"], UprightCylinder(1.0, radius), GREEN, _shift(0.5))
    tip = UprightCylinder(head, radiusTop=0.0, radiusBottom=2.6 * radius)
    _put(root["head"]["body"], tip, GREEN, _shift(0.5 * head))
    cone = UprightCylinder(height, radiusTop=friction * height, radiusBottom=0.0)
    _put(root["cone"]["body"], cone, YELLOW, _shift(0.5 * height), 0.22)


def _put(place: Any, body: Any, colour: str, at: FloatArray, opacity: float = 1.0) -> None:
    place.set_object(body, material(colour, opacity))
    place.set_transform(at)


def material(colour: str, opacity: float) -> mg.MeshPhongMaterial:
    """Return a surface of a colour written #RRGGBB."""
    seen = {"opacity": opacity, "transparent": opacity < 1.0, "depthWrite": opacity >= 1.0}
    return mg.MeshPhongMaterial(color=int(colour[1:], 16), reflectivity=0.1, **seen)


def _shift(height: float) -> FloatArray:
    return np.asarray(pin.SE3(np.eye(3), np.array([0.0, 0.0, height])).homogeneous)
