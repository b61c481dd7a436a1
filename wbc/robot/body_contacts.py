"""Contact points and hulls of the bodies of a robot, from the geometry of its model file.

A solid is represented by points and balls that are fixed to its link. On ground that is flat where
they touch, spheres, capsules and boxes are exact.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import RobotError, require_known
from wbc.robot.robot import ContactPoint, Robot

# Share of a hull's size by which points may leave one plane: single precision of mesh files.
_SAME = 1e-7
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
"""(8, 3) of the box from -1 to 1."""


class Hull(NamedTuple):
    """The convex hull of points, or of balls at them.

    Attributes:
        name: of the solid.
        body: name of the link that carries it, empty for the ground.
        joint: number of pinocchio's joint that moves it, 0 for the world.
        corners: (n, 3) [m], on the joint.
        planes: (f, 4) of the faces: normal out of the hull, and its distance from the origin;
            none where the points lie in a plane or are balls.
        edges: (e, 12) two ends, and for both faces beside the edge a unit vector into the face at
            a right angle to the edge; zeros where there are no faces.
        radius: of balls at the corners [m].
        thickness: least width [m].
    """

    name: str
    body: str
    joint: int
    corners: FloatArray
    planes: FloatArray
    edges: FloatArray
    radius: float
    thickness: float


def hull_of(name: str, body: str, joint: int, points: FloatArray, radius: float = 0.0) -> Hull:
    """Return the hull of points (n, 3), or of one or two balls at them; arguments as of `Hull`."""
    none = np.empty((0, 4))
    if radius > 0.0:
        ends = np.concatenate((*points[:2], np.zeros(6)))[None] if len(points) == 2 else none
        return Hull(name, body, joint, points, none, ends.reshape(-1, 12), radius, 2.0 * radius)
    # scipy.spatial is half of the time that `import wbc` takes; few robots have hulls.
    from scipy.spatial import QhullError

    try:
        planes, edges = _faces(points)
    except (QhullError, ValueError):  # fewer than four points, or all in one plane
        return Hull(name, body, joint, points, none, none.reshape(-1, 12), 0.0, 0.0)
    thickness = float((planes[:, 3] - (points @ planes[:, :3].T).min(axis=0)).min())
    return Hull(name, body, joint, points, planes, edges, 0.0, thickness)


def ground_box(center: FloatArray, rotation: FloatArray, low: FloatArray, high: FloatArray) -> Hull:
    """Return the hull of a box, without the edges and corners that are infinitely far away.

    Args:
        center: (3,) [m], world.
        rotation: (3, 3) from its axes to the world's.
        low, high: (3,) [m] along its own axes; infinite where it has no face.
    """
    far = 1e3 + np.nan_to_num(np.abs([low, high]), posinf=0.0).max()
    ends = np.array([np.maximum(low, -far), np.minimum(high, far)])
    corners = np.where(CORNERS < 0.0, *ends)
    whole, near = hull_of("ground", "", 0, corners), np.abs(corners) < far
    start, end = whole.edges[:, :3], whole.edges[:, 3:6]
    kept = whole.edges[~((start == end) & (np.abs(start) == far)).any(axis=1)].reshape(-1, 4, 3)
    placed = (kept @ rotation.T).reshape(-1, 12)
    placed[:, :6] += np.tile(center, 2)
    normals = whole.planes[:, :3] @ rotation.T
    planes = np.column_stack((normals, whole.planes[:, 3] + normals @ center))
    corners = corners[near.all(axis=1)] @ rotation.T + center
    return whole._replace(corners=corners, planes=planes, edges=placed)


def _faces(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return planes and edges, see `Hull`, of the hull of points (n, 3).

    Raises:
        QhullError: points that span no volume.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    size = float(np.ptp(points, axis=0).max())
    planes = hull.equations * [1.0, 1.0, 1.0, -1.0]
    same = np.abs(planes[:, None] - planes).max(axis=2) <= _SAME * max(size, 1.0)
    own, face = np.unique(same.argmax(axis=1), return_inverse=True)  # of each triangle
    edges = []
    for i, (triangle, beside) in enumerate(zip(hull.simplices, hull.neighbors, strict=True)):
        for corner, j in zip(triangle, beside, strict=True):
            if i < j and face[i] != face[j]:
                first, second = points[[number for number in triangle if number != corner]]
                along = (second - first) / np.linalg.norm(second - first)
                opposite = next(n for n in hull.simplices[j] if n not in triangle)
                inward = np.array([points[corner], points[opposite]]) - first
                inward -= np.outer(inward @ along, along)
                inward /= np.linalg.norm(inward, axis=1)[:, None]
                edges.append(np.concatenate((first, second, *inward)))
    return planes[own], np.reshape(edges, (-1, 12))


_TURN, _HEIGHT = 2.399963 * (np.arange(400) + 0.5), 1.0 - (np.arange(400) + 0.5) / 200.0
_WIDE = np.sqrt(1.0 - _HEIGHT**2)
# (400, 3) evenly over the sphere, 10 degrees apart: golden angle around, even steps up
_DIRECTIONS = np.column_stack((_WIDE * np.cos(_TURN), _WIDE * np.sin(_TURN), _HEIGHT))
_RIM = 8  # points on the rim of a disc: lying on its side it sinks by 1 - cos(pi/8) = 8 % of r


def body_surfaces(robot: Robot) -> tuple[tuple[ContactPoint, ...], tuple[Hull, ...]]:
    """Return contact points of a robot's bodies, beside those that it has, and their hulls.

    - sphere: a ball; capsule: a ball at each end; box: its eight corners;
    - cylinder: the two balls of the capsule inside it where it is longer than wide, else eight
      points of each rim;
    - mesh: as many vertices of its convex hull as it takes until the rest sticks out of them by
      at most `depth`.

    Points of a solid that are nearer to a contact of the robot than the solid is thick are left
    out: that contact (a foot, say) stands for them. The hull of a solid is that of the points that
    are left, with which its edges and faces meet the edges and corners of the ground, and other
    bodies.

    Args:
        robot: loaded from a URDF or MJCF file with collision geometry. Its surface says which
            bodies touch, their friction, and how well meshes are met.

    Raises:
        RobotError: no collision geometry, a body that does not exist, or a kind of shape that has
            no points (a half space, a height field).
    """
    links = robot.surface.links
    for link in links or ():
        require_known(RobotError, f"body of '{robot.name}'", link, robot.bodies)
    shapes = collision_solids(robot).geometryObjects
    if not len(shapes):
        raise RobotError(
            f"'{robot.name}' has no collision geometry that can be read. Give its model file "
            "<collision> elements (URDF) or geoms (MJCF) and install their meshes, or give it "
            "more [[contacts]]."
        )
    found: list[ContactPoint] = []
    hulls: list[Hull] = []
    for item in shapes:
        body = robot.bodies[item.parentJoint - 1] if item.parentJoint else ""
        if body and (links is None or body in links):
            points, radius = _free_points(robot, item)
            frame = robot.model.frames[item.parentFrame]
            for number, place in enumerate(points):
                offset = frame.placement.actInv(place)
                name = f"{item.name}/{number}"
                found.append(ContactPoint(name, frame.name, offset, robot.surface.friction, radius))
            if len(points):
                hulls.append(hull_of(item.name, body, item.parentJoint, points, radius))
    return tuple(found), tuple(hulls)


def _free_points(robot: Robot, item: Any) -> tuple[FloatArray, float]:
    """Return the points (n, 3) of a solid that no contact stands for, on its joint, and radii."""
    points, radius, thickness = _points(item, robot.surface.depth)
    placed = [(*robot.contact_place(contact), contact.radius) for contact in robot.contacts]
    known = [(at, own) for carrier, at, own in placed if carrier == item.parentJoint]
    kept = [
        place
        for place in (item.placement.act(point) for point in points)
        if all(np.linalg.norm(place - at) - own - radius >= thickness for at, own in known)
    ]
    return np.reshape(kept, (-1, 3)), radius


def _points(item: Any, depth: float) -> tuple[FloatArray, float, float]:
    """Return points (n, 3) of a solid in its own axes, the radius of balls there, its thickness."""
    shape = item.geometry
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), float(shape.radius), 2.0 * float(shape.radius)
    if isinstance(shape, coal.Box):
        sides = np.asarray(shape.halfSide)
        return CORNERS * sides, 0.0, 2.0 * float(sides.min())
    if isinstance(shape, coal.Capsule | coal.Cylinder):
        radius, half = float(shape.radius), float(shape.halfLength)
        inside = isinstance(shape, coal.Cylinder)
        if inside and half < radius:
            turn = 2.0 * np.pi * np.arange(_RIM) / _RIM
            rim = np.column_stack((radius * np.cos(turn), radius * np.sin(turn)))
            ends = [np.insert(rim, 2, z, axis=1) for z in (-half, half)]
            return np.concatenate(ends), 0.0, 2.0 * half
        end = half - radius if inside else half
        return np.array([[0.0, 0.0, -end], [0.0, 0.0, end]]), radius, 2.0 * radius
    if not hasattr(shape, "points"):
        raise RobotError(
            f"the collision shape '{item.name}' ({type(shape).__name__}) has no contact points. "
            "Use spheres, capsules, boxes, cylinders or meshes, or leave its link out."
        )
    vertices = np.asarray(shape.points()).reshape(-1, 3)
    return _hull(vertices, depth), 0.0, float(np.ptp(vertices, axis=0).min())


def _hull(vertices: FloatArray, depth: float) -> FloatArray:
    """Return the fewest vertices (n, 3), by one after another, that others pass by `depth` at most.

    The one that sticks out most, seen from many directions, is taken next.
    """
    seen = vertices @ _DIRECTIONS.T
    outermost, number = seen.max(axis=0), seen.argmax(axis=0)
    chosen = [int(number[0])]
    while True:
        out = outermost - seen[chosen].max(axis=0)
        worst = int(out.argmax())
        if out[worst] <= depth:
            return vertices[chosen]
        chosen.append(int(number[worst]))


def placed_geometry(robot: Robot, kind: pin.GeometryType) -> list[pin.GeometryObject]:
    """Return the visuals or collision solids of the robot's model file; none without any.

    The links are found by their frame's name, so that a robot with a free-flyer or with welded
    joints finds them too. Their joints, frames and placements are those of the robot.
    """
    if robot.source is None or robot.source.model is None:
        return []
    try:
        whole, geometry = _model_geometry(robot.source.model, kind)
    except (ValueError, RuntimeError):
        # The links moved this far, so the file is sound: only its meshes are not installed.
        return []
    placed = []
    for item in map(pin.GeometryObject, geometry.geometryObjects):
        frame = whole.frames[item.parentFrame]
        if robot.model.existFrame(frame.name):
            item.parentFrame = robot.model.getFrameId(frame.name)
            here = robot.model.frames[item.parentFrame]
            item.parentJoint = here.parentJoint
            item.placement = here.placement * frame.placement.inverse() * item.placement
            placed.append(item)
    return placed


def collision_solids(robot: Robot) -> pin.GeometryModel:
    """Return the collision solids of the robot's model file and its surface; empty without any.

    Meshes become their convex hulls.

    Raises:
        RobotError: a solid of the surface sits on a link that the robot does not have.
    """
    found = pin.GeometryModel()
    for item in placed_geometry(robot, pin.GeometryType.COLLISION):
        if hasattr(item.geometry, "buildConvexRepresentation"):
            item.geometry.buildConvexRepresentation(False)
            item.geometry = item.geometry.convex or item.geometry
        found.addGeometryObject(item)
    known = [one.name for one in robot.model.frames]
    for solid in robot.surface.solids:
        require_known(RobotError, f"frame of '{robot.name}'", solid.link, known)
        frame = robot.model.getFrameId(solid.link)
        own = robot.model.frames[frame]
        at = own.parentJoint, frame, own.placement
        found.addGeometryObject(pin.GeometryObject(solid.link, *at, solid.shape))
    return found


def _model_geometry(path: Path, kind: pin.GeometryType) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the links of a model file, and its visuals or collision solids."""
    if path.suffix == ".xml":
        model = pin.buildModelFromMJCF(str(path))
        return model, pin.buildGeomFromMJCF(model, str(path), kind)
    model = pin.buildModelFromUrdf(str(path))
    # `package://` addresses count from the folder above the package.
    folders = [str(folder) for folder in path.resolve().parents]
    return model, pin.buildGeomFromUrdf(model, str(path), kind, package_dirs=folders)
