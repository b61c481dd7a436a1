"""From pinocchio's geometries to what meshcat draws."""

from __future__ import annotations

from typing import Any

import coal
import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray

# three.js runs cylinders along y, everybody else along z. meshcat sends this matrix row by row
# and three.js reads it column by column, so that what is written here is the transpose.
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
_MAX_TRIANGLES = 20000


class UprightCylinder(mg.Cylinder):  # type: ignore[misc]
    """A cylinder or cone along z, centred."""

    def intrinsic_transform(self) -> FloatArray:
        """Return the rotation from three.js' y axis to z, transposed, (4, 4)."""
        return _UPRIGHT


def capsule(length: float, radius: float) -> mg.TriangularMeshGeometry:
    """Return a capsule along z, centred; `length` is that of its straight part [m]."""
    around, along = 20, 6
    tilt = np.linspace(0.0, 0.5 * np.pi, along + 1)
    rings = [(-0.5 * length - radius * np.sin(a), radius * np.cos(a)) for a in tilt[::-1]]
    rings += [(0.5 * length + radius * np.sin(a), radius * np.cos(a)) for a in tilt]
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    vertices = np.array(
        [[r * np.cos(a), r * np.sin(a), z] for z, r in rings for a in angle], dtype=np.float32
    )
    faces = []
    for ring in range(len(rings) - 1):
        for i in range(around):
            j = (i + 1) % around
            low, high = ring * around, (ring + 1) * around
            faces += [[low + i, low + j, high + i], [low + j, high + j, high + i]]
    return mg.TriangularMeshGeometry(vertices, np.array(faces, dtype=np.uint32))


def meshcat_geometry(shape: Any, scale: FloatArray) -> Any | None:
    """Return what meshcat draws for a coal shape, None for one that has no surface to draw.

    Args:
        shape: a coal collision geometry (pinocchio's GeometryObject.geometry).
        scale: (3,), applied to meshes only.
    """
    match shape:
        case coal.Box():
            return mg.Box([float(2.0 * x) for x in shape.halfSide])
        case coal.Sphere():
            return mg.Sphere(float(shape.radius))
        case coal.Ellipsoid():
            return mg.Ellipsoid([float(x) for x in shape.radii])
        case coal.Cylinder():
            return UprightCylinder(float(2.0 * shape.halfLength), float(shape.radius))
        case coal.Cone():
            return UprightCylinder(
                float(2.0 * shape.halfLength), radiusTop=0.0, radiusBottom=float(shape.radius)
            )
        case coal.Capsule():
            return capsule(float(2.0 * shape.halfLength), float(shape.radius))
        case coal.BVHModelBase():
            faces = np.array([list(shape.tri_indices(i)) for i in range(shape.num_tris)])
            return _mesh(np.asarray(shape.vertices()), faces, scale)
        case coal.Convex():
            faces = np.array([list(shape.polygons(i)) for i in range(shape.num_polygons)])
            return _mesh(np.asarray(shape.points()), faces, scale)
    return None


def _mesh(vertices: FloatArray, faces: FloatArray, scale: FloatArray) -> Any | None:
    if len(faces) == 0:
        return None
    # A playback travels by mail; what one cannot see at a robot's size is left out.
    if len(faces) > _MAX_TRIANGLES:
        vertices, faces = _clustered(vertices, faces)
    return mg.TriangularMeshGeometry(
        np.asarray(vertices, dtype=np.float32), np.asarray(faces, dtype=np.uint32)
    )


def _clustered(vertices: FloatArray, faces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Merge the vertices of each cell of a grid and drop the triangles that collapse."""
    low, span = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    cells = np.round((vertices - low) / (span / 96.0)).astype(np.int64)
    _, inverse = np.unique(cells, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    count = np.bincount(inverse)[:, None]
    merged = np.stack([np.bincount(inverse, weights=vertices[:, i]) for i in range(3)], axis=1)
    small = inverse[faces]
    kept = (
        (small[:, 0] != small[:, 1]) & (small[:, 1] != small[:, 2]) & (small[:, 0] != small[:, 2])
    )
    return merged / count, np.unique(small[kept], axis=0)


def along(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) that turns z into `direction` (3,)."""
    unit = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    if unit[2] < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), unit)
    return np.asarray(turn.toRotationMatrix())
