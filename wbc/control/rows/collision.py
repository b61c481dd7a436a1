"""Bodies that keep apart from each other and from obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, final

import coal
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.control.kinematics import Kinematics
from wbc.control.tree import place_distances
from wbc.errors import ControlError, unknown_name
from wbc.robot import Robot

_FLAT = 1e-9  # thickness over size; coal's hull of a mesh with none (4e-17) ends the process


_NO_FRAME = 2**64 - 1
"""What pinocchio says of a solid that was given a joint and no frame."""


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
class CollisionLimit:
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
    margin: float = 0.02
    rate: float = 10.0
    influence: float = 0.3

    def __post_init__(self) -> None:
        """Check names and ranges."""
        names = [shape.name for shape in self.shapes]
        if len(set(names)) < len(names):
            raise ControlError(f"two shapes have one name: {', '.join(names)}.")
        for name in (name for pair in self.pairs for name in pair):
            if name not in names:
                raise ControlError(unknown_name("shape", name, names))
        if not 0.0 <= self.margin < self.influence or not 0.0 < self.rate < np.inf:
            raise ControlError(
                "a collision limit needs 0 <= margin < influence [m] and a rate > 0 1/s, got "
                f"{self.margin}, {self.influence} and {self.rate}."
            )

    @classmethod
    def of(cls, robot: Robot, geometry: pin.GeometryModel, **settings: float) -> CollisionLimit:
        """Return the limit of all collision pairs of a geometry model of the robot's own model.

        Load it with `pin.buildGeomFromUrdf(robot.model, ...)` and choose its pairs first: links
        that a joint connects overlap, so leave their pairs out.

        Raises:
            ControlError: the geometry was loaded for another model, as that of the URDF without
                the free-flyer or with joints that are locked here: its solids would stand on other
                links.
        """
        for solid in geometry.geometryObjects:
            _check_link(robot.model, solid)
        shapes = [
            Shape(
                name=solid.name,
                geometry=solid.geometry,
                frame=str(robot.model.names[solid.parentJoint]),
                placement=solid.placement,
            )
            for solid in geometry.geometryObjects
        ]
        pairs = [
            (shapes[pair.first].name, shapes[pair.second].name) for pair in geometry.collisionPairs
        ]
        return cls(shapes, pairs, **settings)


def _check_link(model: pin.Model, solid: Any) -> None:
    """Raise ControlError for a solid of a geometry that was loaded for another model."""
    joint, frame = int(solid.parentJoint), int(solid.parentFrame)
    fits = joint < model.njoints
    if fits and frame != _NO_FRAME:
        fits = frame < model.nframes and int(model.frames[frame].parentJoint) == joint
    if fits:
        link = solid.name.rpartition("_")[0]  # pinocchio calls the solids of a link link_0, link_1
        fits = not model.existFrame(link) or (
            int(model.frames[model.getFrameId(link)].parentJoint) == joint
        )
    if not fits:
        raise ControlError(
            f"the geometry was loaded for another model: solid '{solid.name}' belongs to joint "
            f"{joint}, which is another one here. Load it with "
            "pin.buildGeomFromUrdf(robot.model, ...)."
        )


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
        self._limit, p = limit, len(limit.pairs)
        used = list(dict.fromkeys(name for pair in limit.pairs for name in pair))
        shapes = {shape.name: shape for shape in limit.shapes}
        self._solids = _Solids([shapes[name] for name in used], model)
        pairs = [[used.index(name) for name in pair] for pair in limit.pairs]
        self._pairs = frozen(np.array(pairs, dtype=np.int_).reshape(p, 2), np.int_)
        geometry = [shapes[name].geometry for name in used]
        self._measures = [coal.ComputeDistance(geometry[i], geometry[j]) for i, j in pairs]
        self.labels = tuple(f"distance of '{one}' and '{other}'" for one, other in limit.pairs)
        self._joints = frozen(self._solids.joints[self._pairs], np.int_)
        self.rows, self.least = np.zeros((p, model.nv)), np.zeros(p)
        self.distances, self._points = np.zeros(p), np.zeros((p, 9))
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        # started at the middles of boxes around the solids: 1.3 ms in place of 2.0 ms for the
        # 545 pairs of G1, of which 214 are near; hulls have about 1000 corners
        self._request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
        self._couples = [(i, j) for i, j in pairs]

    def fill(self, kinematics: Kinematics) -> None:
        """Evaluate all pairs at the present state."""
        points, limit, result = self._points, self._limit, self._result
        self._solids.place(kinematics)
        self.distances[:] = self._solids.apart(self._pairs)
        near = np.flatnonzero(self.distances < limit.influence)
        measured = []
        for i in near.tolist():
            one, other = self._couples[i]
            places = self._solids.transform(one), self._solids.transform(other)
            result.clear()
            self.distances[i] = self._measures[i](*places, self._request, result)
            one_point, other_point = result.getNearestPoint1(), result.getNearestPoint2()
            # the normal is a view of what the next pair overwrites
            measured.append((one_point, other_point, result.normal.copy()))
        if measured:
            points[near] = np.array(measured).reshape(-1, 9)
        numbers = frozen([limit.margin, limit.rate, limit.influence])
        place_distances(
            kinematics.tree, self._joints, points, self.distances, numbers, self.rows, self.least
        )


class _Solids:
    """Where solids are, and balls around them.

    Attributes:
        joints: joint that carries each solid (s,).
    """

    def __init__(self, shapes: Sequence[Shape], model: pin.Model) -> None:
        joints, local, balls = [], [], []
        for shape in shapes:
            if not model.existFrame(shape.frame):
                known = [frame.name for frame in model.frames]
                raise ControlError(
                    f"shape '{shape.name}': " + unknown_name("frame", shape.frame, known)
                )
            frame = model.frames[model.getFrameId(shape.frame)]
            joints.append(frame.parentJoint)
            local.append((frame.placement * shape.placement).homogeneous[:3])
            balls.append(_ball(shape.geometry))
        self.joints = np.array(joints, dtype=np.int_)
        self._local = np.array(local).reshape(-1, 3, 4)
        self._balls = np.array(balls, dtype=np.float64).reshape(-1, 4)
        self._places = np.zeros_like(self._local)
        self._made: dict[int, coal.Transform3s] = {}

    def place(self, kinematics: Kinematics) -> None:
        """Take the places of the joints at the present state."""
        joints = kinematics.joint_places[self.joints]
        turns = joints[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1)
        np.matmul(turns, self._local, out=self._places)
        self._places[:, :, 3] += joints[:, 9:]
        self._made.clear()

    def apart(self, pairs: IntArray) -> FloatArray:
        """Return how far the balls around the solids of pairs (p, 2) are apart, (p,) [m]."""
        centers = (self._places[:, :, :3] @ self._balls[:, :3, None])[:, :, 0]
        centers += self._places[:, :, 3]
        between = centers[pairs[:, 0]] - centers[pairs[:, 1]]
        radii = self._balls[pairs, 3].sum(axis=1)
        return np.asarray(np.sqrt(np.einsum("pi,pi->p", between, between)) - radii)

    def transform(self, solid: int) -> coal.Transform3s:
        """Return the place of a solid, made once per state."""
        if solid not in self._made:
            place = self._places[solid]
            self._made[solid] = coal.Transform3s(place[:, :3], place[:, 3])
        return self._made[solid]


def _ball(geometry: Any) -> FloatArray:
    """Return centre and radius (4,) [m] of a ball around a solid; half spaces have no centre."""
    geometry.computeLocalAABB()
    if not np.isfinite(geometry.aabb_radius):
        return np.array([0.0, 0.0, 0.0, np.inf])
    return np.array([*geometry.aabb_center, geometry.aabb_radius])


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
