"""From pinocchio's geometries to what meshcat draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coal
import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray

# three.js runs cylinders along y, everybody else along z. meshcat sends this matrix row by row
# and three.js reads it column by column, so that what is written here is the transpose.
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
# Of one mesh. TALOS (144 000 triangles, 24 072 in its chest) makes a page of 5.2 MB; merging its
# vertices to 4000 triangles per mesh made one of 3.6 MB, in which thin walls pierced one another.
_MAX_TRIANGLES = 30_000


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


def meshcat_geometry(shape: Any) -> Any | None:
    """Return what meshcat draws for a coal shape (pinocchio's GeometryObject.geometry).

    None for one that has no surface to draw. Meshes come with their scale applied.
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
            return _mesh(np.asarray(shape.vertices()), _corners(shape.tri_indices, shape.num_tris))
        case coal.Convex():
            return _mesh(np.asarray(shape.points()), _corners(shape.polygons, shape.num_polygons))
    return None


def _corners(triangle: Callable[[int], Any], count: int) -> IntArray:
    """Return the vertex numbers (count, 3) of coal's triangles, which do not iterate."""
    triangles = (triangle(i) for i in range(count))
    return np.array([(t[0], t[1], t[2]) for t in triangles], dtype=np.int64).reshape(-1, 3)


def _mesh(vertices: FloatArray, faces: IntArray) -> Any | None:
    if len(faces) == 0:
        return None
    # A playback travels by mail; what one cannot see at a robot's size is left out.
    cells = 96.0
    coarse, kept = vertices, faces
    while len(kept) > _MAX_TRIANGLES:
        coarse, kept = _clustered(vertices, faces, cells)
        cells *= 0.75
    return mg.TriangularMeshGeometry(
        np.asarray(coarse, dtype=np.float32), np.asarray(kept, dtype=np.uint32)
    )


def _clustered(vertices: FloatArray, faces: IntArray, cells: float) -> tuple[FloatArray, IntArray]:
    """Merge the vertices in each cell of a grid and drop the triangles that collapse."""
    low, span = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    keys = np.round((vertices - low) * (cells / span)).astype(np.int64)
    _, inverse = np.unique(keys, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    count = np.bincount(inverse)[:, None]
    merged = np.stack([np.bincount(inverse, weights=vertices[:, i]) for i in range(3)], axis=1)
    small = inverse[faces]
    a, b, c = small.T
    kept = small[(a != b) & (b != c) & (a != c)]
    return merged / count, _one_sided(merged / count, kept)


def _one_sided(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return each triangle once; of two that face one another the one that faces outwards.

    The two sides of a thin wall fall into the same cells. Drawn both, in the same place, they
    would flicker.
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    outwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) / 3.0 - vertices.mean(0))
    faces = faces[np.argsort(-outwards, kind="stable")]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return np.asarray(faces[np.sort(first)])


def along(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) that turns z into `direction` (3,)."""
    unit = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    if unit[2] < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), unit)
    return np.asarray(turn.toRotationMatrix())
