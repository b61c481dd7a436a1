"""From pinocchio's geometries to what meshcat draws."""

from __future__ import annotations

from itertools import product
from typing import Any

import coal
import meshcat.geometry as mg
import numpy as np
import pinocchio as pin
from pinocchio.visualize.meshcat_visualizer import loadMesh, loadPrimitive

from wbc.arrays import FloatArray, IntArray
from wbc.robot import Robot
from wbc.robot.body_contacts import placed_geometry

# three.js runs cylinders along y, everybody else along z. meshcat sends this matrix row by row
# and three.js reads it column by column, so that what is written here is the transpose.
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
# Of one mesh, and cells along its longest side where it has more: a page of TALOS (24 072 triangles
# in its chest) has 5.2 MB, one of ANYmal (124 882 in its base) 11.1 MB whole.
_MAX_TRIANGLES, _CELLS = 30_000, 96


class UprightCylinder(mg.Cylinder):  # type: ignore[misc]
    """A cylinder or cone along z, centred."""

    def intrinsic_transform(self) -> FloatArray:
        """Return the rotation from three.js' y axis to z, transposed, (4, 4)."""
        return _UPRIGHT


def meshcat_geometry(shape: Any) -> Any | None:
    """Return what meshcat draws for a coal shape (pinocchio's GeometryObject.geometry).

    None for one that has no surface to draw. Meshes come with their scale applied.
    """
    match shape:
        case coal.Ellipsoid():  # which pinocchio does not draw
            return mg.Ellipsoid(shape.radii.tolist())
        case coal.Box() | coal.Sphere() | coal.Cylinder() | coal.Cone() | coal.Capsule():
            return loadPrimitive(pin.GeometryObject("", 0, pin.SE3.Identity(), shape))
        case coal.BVHModelBase() | coal.Convex():
            mesh = loadMesh(shape)
            if len(getattr(mesh, "faces", ())) > _MAX_TRIANGLES:  # a playback travels by mail
                return mg.TriangularMeshGeometry(*_clustered(mesh.vertices, mesh.faces))
            return mesh if hasattr(mesh, "faces") else None
    return None


def _clustered(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge the vertices in each cell of a grid; drop triangles that collapse, keep each once.

    The two sides of a thin wall fall into the same cells: both would be drawn in one place.
    """
    cells = np.round((vertices - vertices.min(axis=0)) * (_CELLS / np.ptp(vertices, axis=0).max()))
    _, kept, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    small = cell.reshape(-1)[faces]
    corners, first = np.unique(np.sort(small, axis=1), axis=0, return_index=True)
    whole = (np.diff(corners, axis=1) > 0).all(axis=1)
    return vertices[kept], small[np.sort(first[whole])]


def along(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) that turns z into `direction` (3,)."""
    up = np.array([0.0, 0.0, 1.0])
    return np.asarray(pin.Quaternion.FromTwoVectors(up, direction).toRotationMatrix())


_NEUTRALS = ("#5F6B7A", "#8C98A8", "#B4BECB")


class LinkShape:
    """One drawn body.

    Attributes:
        name: unique on the robot.
        joint: number of the joint that moves it, 0 for the world.
        placement: of the body in the frame of that joint.
        geometry: what meshcat draws.
        colour: written #RRGGBB.
        low, high: (3,) [m] ends of its box in the frame of the joint.
        corners: (8, 3) [m] of that box.
    """

    def __init__(self, name: str, joint: int, place: pin.SE3, body: Any, colour: str = "") -> None:
        """Draw a shape of coal, in a neutral colour if none is told."""
        body.computeLocalAABB()
        moved = _box_corners(body.aabb_local.min_, body.aabb_local.max_) @ place.rotation.T
        self.low, self.high = (end + place.translation for end in (moved.min(0), moved.max(0)))
        self.corners = _box_corners(self.low, self.high)
        self.name, self.joint, self.placement = name, joint, place
        self.geometry = meshcat_geometry(body)
        self.colour = colour or _NEUTRALS[joint % len(_NEUTRALS)]


def _box_corners(low: FloatArray, high: FloatArray) -> FloatArray:
    return np.array(list(product(*zip(low, high, strict=True))))


def robot_shapes(robot: Robot) -> tuple[LinkShape, ...]:
    """Return the visuals of the robot's model file, or capsules between its joints without any."""
    shapes = []
    for item in placed_geometry(robot, pin.GeometryType.VISUAL):
        red, green, blue = (round(255.0 * float(part)) for part in item.meshColor[:3])
        # pinocchio's own default for "no material" tells nothing; a neutral per link does.
        told = not np.allclose(item.meshColor[:3], 0.9)
        colour = f"#{red:02X}{green:02X}{blue:02X}" if told else ""
        at = item.parentJoint, item.placement
        shapes.append(LinkShape(item.name, *at, item.geometry, colour))
    drawn = [shape for shape in shapes if shape.geometry is not None]
    return tuple(drawn) if any(shape.joint > 0 for shape in drawn) else stick_shapes(robot)


def stick_shapes(robot: Robot) -> tuple[LinkShape, ...]:
    """Return capsules from each joint to the joints and contacts that it carries.

    A link on which nothing is far away is drawn as the uniform box of its mass and inertia.
    """
    model = robot.model
    ends = [robot.ends(joint) for joint in range(model.njoints)]
    lengths = [float(np.linalg.norm(end)) for each in ends for end in each]
    radius = 0.05 * max([length for length in lengths if length > 1e-9], default=0.5)
    shapes: list[LinkShape] = []
    for joint in range(1, model.njoints):
        name, far = model.names[joint], [e for e in ends[joint] if np.linalg.norm(e) > 1e-9]
        # Balls of one size in one place flicker: links that meet differ in thickness.
        own = radius * (1.0 - 0.05 * (joint % len(_NEUTRALS)))
        for i, end in enumerate(far):
            rod = coal.Capsule(own, float(np.linalg.norm(end)))
            place = pin.SE3(along(end), 0.5 * end)
            shapes.append(LinkShape(f"{name}_{i}", joint, place, rod))
        if not far and model.inertias[joint].mass > 0.0:
            place, sides = _inertia_box(model.inertias[joint])
            box = coal.Box(*np.maximum(sides, radius).tolist())
            shapes.append(LinkShape(f"{name}_box", joint, place, box))
    return tuple(shapes)


def _inertia_box(inertia: pin.Inertia) -> tuple[pin.SE3, FloatArray]:
    """Return placement and sides (3,) [m] of the uniform box that has an inertia."""
    moments, axes = np.linalg.eigh(np.asarray(inertia.inertia))
    squares = 6.0 / inertia.mass * (moments.sum() - 2.0 * moments)
    if np.linalg.det(axes) < 0.0:
        axes = axes * np.array([1.0, 1.0, -1.0])
    return pin.SE3(axes, np.asarray(inertia.lever)), np.sqrt(np.maximum(squares, 0.0))
