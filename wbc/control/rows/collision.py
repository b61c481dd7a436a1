"""Bodies that keep apart from each other and from obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, final

import coal
import numpy as np
import pinocchio as pin

from wbc.arrays import frozen, must
from wbc.control.inputs import Checked
from wbc.control.kinematics import Kinematics, frame_number, place_distances
from wbc.errors import ControlError, require_known

_FLAT = 1e-9  # thickness over size; coal's hull of a mesh with none (4e-17) ends the process


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """A convex solid on a link, or an obstacle in the world.

    A mesh becomes its convex hull, so that hollows count as full. The distance of two solids is
    negative where they overlap, also where one lies inside the other.

    Attributes:
        name: how messages call it.
        geometry: of coal: `coal.Sphere`, `coal.Capsule`, `coal.Box`, a mesh.
        frame: name of a frame of the model; "universe" for an obstacle that stands still.
        placement: of the solid in that frame.

    Raises:
        ControlError: a geometry that coal cannot take as a convex solid.
    """

    name: str
    geometry: Any
    frame: str = "universe"
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)

    def __post_init__(self) -> None:
        """Take the hull of a mesh."""
        object.__setattr__(self, "geometry", _convex(self.geometry, self.name))


@final
@dataclass(frozen=True, eq=False)
class CollisionLimit(Checked):
    """Keeps the distance d of pairs of shapes above a margin.

    With n from one solid to the other at their nearest points,

        d'' + 2 rate d' + rate^2 (d - margin) >= 0,      d'' = n'(J_other - J_one) qdd + drift,

    so that d comes down to the margin like a critically damped spring, and no faster. How the
    nearest points wander over the solids is left out of the drift. Pairs farther apart than
    `influence` are left alone. Solids that are already too near are driven apart; where torque
    limits or contacts do not allow that, the tick has no solution.

    Attributes:
        shapes: the solids.
        pairs: names of the shapes that must not touch, two by two.
        margin: [m] that is kept between the solids of a pair.
        rate: [1/s] with which they may come near.
        influence: [m] beyond which a pair costs nothing but its distance.
    """

    shapes: Sequence[Shape]
    pairs: Sequence[tuple[str, str]]
    margin: float = field(default=0.02, metadata=must(">= 0 and < {0.influence} m"))
    rate: float = field(default=10.0, metadata=must("> 0 1/s and < inf"))
    influence: float = 0.3

    _told = "collision limit: "

    def __post_init__(self) -> None:
        """Check names and ranges."""
        names = [shape.name for shape in self.shapes]
        if len(set(names)) < len(names):
            raise ControlError(f"two shapes have one name: {', '.join(names)}.")
        for name in (name for pair in self.pairs for name in pair):
            require_known(ControlError, "shape", name, names)
        super().__post_init__()


class CollisionRows:
    """Evaluates a `CollisionLimit`: rows (p, nv) and least values (p,) of what they times qdd is.

    Attributes:
        labels: (p,) what every pair is called in messages.
        rows: n'(J_other - J_one) (p, nv).
        least: (p,) [m/s^2], -inf where a pair is far apart.
        distances: (p,) [m] of the last state, negative where solids overlap. Where balls around
            two solids are farther apart than `influence`, the distance of the balls.
    """

    def __init__(self, limit: CollisionLimit, model: pin.Model) -> None:
        """Resolve the frames.

        Raises:
            ControlError: a frame that the model does not have.
        """
        used = list(dict.fromkeys(name for pair in limit.pairs for name in pair))
        shapes = {shape.name: shape for shape in limit.shapes}
        self._geometry, balls = pin.GeometryModel(), []
        for name in used:
            shape = shapes[name]
            number = frame_number(model, shape.frame, f"shape '{name}': ")
            frame = model.frames[number]
            place, solid = frame.placement * shape.placement, shape.geometry
            solid.computeLocalAABB()
            center, radius = np.array(solid.aabb_center), float(solid.aabb_radius)
            held = pin.GeometryObject(name, frame.parentJoint, number, place, solid)
            self._geometry.addGeometryObject(held)
            around = place.act(center) if np.isfinite(radius) else np.zeros(3)  # of a half space
            balls.append([frame.parentJoint, *around, radius])
        p, spheres = len(limit.pairs), np.array(balls, dtype=np.float64).reshape(-1, 5)
        pairs = [[used.index(name) for name in pair] for pair in limit.pairs]
        self._pairs = np.array(pairs, dtype=np.int_).reshape(p, 2)
        for one, other in pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(one, other))
        self._carriers, self._centers = spheres[:, 0].astype(np.int_), spheres[:, 1:4]
        self._radii = spheres[self._pairs, 4].sum(axis=1)
        self._data = self._geometry.createData()
        for request in self._data.distanceRequests:
            # started at the middles of boxes around the solids: 1.3 ms in place of 2.0 ms for the
            # 545 pairs of G1, of which 214 are near; hulls have about 1000 corners
            request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
        self.labels = tuple(f"distance of '{one}' and '{other}'" for one, other in limit.pairs)
        self._joints = frozen(self._carriers[self._pairs], np.int_)
        self._numbers = frozen([limit.margin, limit.rate, limit.influence])
        self.rows, self.least = np.zeros((p, model.nv)), np.zeros(p)
        self.distances, self._points = np.zeros(p), np.zeros((p, 9))

    def fill(self, kinematics: Kinematics) -> None:
        """Evaluate all pairs at the present state."""
        joints, points, data = kinematics.tree.poses[self._carriers], self._points, self._data
        turns = joints[:, :9].reshape(-1, 3, 3)
        centers = np.einsum("sab,sb->sa", turns, self._centers) + joints[:, 9:]
        between = centers[self._pairs[:, 0]] - centers[self._pairs[:, 1]]
        self.distances[:] = np.linalg.norm(between, axis=1) - self._radii
        kinematics.place_solids(self._geometry, data)
        for i in np.flatnonzero(self.distances < self._numbers[2]).tolist():
            found = pin.computeDistance(self._geometry, data, i)
            self.distances[i] = found.min_distance
            points[i, :3], points[i, 3:6] = found.getNearestPoint1(), found.getNearestPoint2()
            points[i, 6:] = found.normal
        rows = self.distances, self._numbers, self.rows, self.least
        place_distances(kinematics.tree, self._joints, points, *rows)


def _convex(geometry: Any, name: str) -> Any:
    """Return a solid, or the convex hull of a mesh."""
    if isinstance(geometry, coal.ShapeBase):
        return geometry
    if not isinstance(geometry, coal.BVHModelBase) or geometry.num_vertices < 4:
        raise ControlError(
            f"shape '{name}': {type(geometry).__name__} is no convex solid; give a sphere, a "
            "capsule, a box, another convex shape of coal, or a mesh of at least four points."
        )
    points = np.array(geometry.vertices())
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if not sizes[-1] > _FLAT * sizes[0]:
        raise ControlError(f"shape '{name}': its mesh is flat; give a thin box in its place.")
    mesh = geometry.clone()  # a mesh keeps its hull, and this one is the caller's
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex
