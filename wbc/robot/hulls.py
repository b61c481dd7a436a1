"""Convex hulls of points on a link: what meets the edges of the ground, and other bodies."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray

_SAME = 1e-7
"""Share of a hull's size by which points may leave one plane: single precision of mesh files."""
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
    planes, edges = _faces(corners)
    kept = [
        edge
        for edge in edges
        if not any(a == b and abs(a) == far for a, b in zip(edge[:3], edge[3:6], strict=True))
    ]
    corners = corners[(np.abs(corners) < far).all(axis=1)]
    placed = np.array([(np.reshape(edge, (4, 3)) @ rotation.T).ravel() for edge in kept])
    placed = placed.reshape(-1, 12)
    placed[:, :6] += np.tile(center, 2)
    normals = planes[:, :3] @ rotation.T
    planes = np.column_stack((normals, planes[:, 3] + normals @ center))
    thickness = float((ends[1] - ends[0]).min())
    return Hull("ground", "", 0, corners @ rotation.T + center, planes, placed, 0.0, thickness)


def _faces(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return planes and edges, see `Hull`, of the hull of points (n, 3).

    Raises:
        QhullError: points that span no volume.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    size = float(np.ptp(points, axis=0).max())
    planes: list[FloatArray] = []
    face = []  # of each triangle
    for equation in hull.equations:
        plane = np.append(equation[:3], -equation[3])
        same = [
            number
            for number, known in enumerate(planes)
            if np.abs(plane - known).max() <= _SAME * max(size, 1.0)
        ]
        face.append(same[0] if same else len(planes))
        if not same:
            planes.append(plane)
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
    return np.array(planes), np.reshape(edges, (-1, 12))
