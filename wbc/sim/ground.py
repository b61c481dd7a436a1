"""The ground: how far a point is from it, and which way is out of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, Ranged, checked, frozen, must
from wbc.errors import SimulationError

PLANE, BOX, BALL, FIELD = 0.0, 1.0, 2.0, 3.0
"""Kinds of solids, first of the numbers of a solid; zeros may follow them.

After it: PLANE normal (3), distance from the world's origin; BOX centre (3), rotation by rows (9),
lowest and highest place along its own axes (3 and 3), infinite where it has no face; BALL centre
(3), radius.
"""


class Terrain(ABC):
    """A rigid ground.

    A ground is made of solids. Each solid is a barrier of its own for every contact point, so that
    a point in a corner touches two of them, and one that slides from one solid to the next lands
    on it. The gap of one solid should be continuous.
    """

    @abstractmethod
    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return distance and normal at points.

        Args:
            points: (k, 3) [m], world.

        Returns:
            gap (k,) [m], negative inside the ground, and the unit normal (k, 3) out of the ground.
        """

    @property
    def solids(self) -> tuple[Terrain, ...]:
        """What the ground is made of; one solid unless a ground says more."""
        return (self,)

    def numbers(self) -> FloatArray | None:
        """Return the solid's numbers for compiled loops (`contacts`); None where they have none.

        The plant then asks `gap` itself, once for all contact points.
        """
        return None


class Solid(Terrain):
    """A ground that compiled loops know by its numbers."""

    @abstractmethod
    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`."""

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`."""
        from wbc.sim.step.contacts import solid_gaps  # who only draws a ground waits for no loops

        gaps, normals = np.empty(len(points)), np.empty((len(points), 3))
        solid_gaps(self.numbers(), np.ascontiguousarray(points), gaps, normals)
        return gaps, normals


def _numbered(kind: float, *numbers: ArrayLike) -> FloatArray:
    """Return the numbers of a solid of a kind."""
    return np.concatenate([np.ravel(number) for number in (kind, *numbers)])


@final
@dataclass(frozen=True, eq=False)
class Plane(Solid):
    """The half space below a plane.

    Attributes:
        normal: (3,) direction out of the ground, world; made a unit vector.
        height: z [m] at which the plane passes the world's origin line x = y = 0.
    """

    normal: FloatArray = field(default_factory=lambda: frozen([0.0, 0.0, 1.0]))
    height: float = 0.0

    def __post_init__(self) -> None:
        """Check and normalise."""
        normal = checked(self.normal, (3,), "normal of the plane", SimulationError)
        if not normal[2] > 0.0:
            raise SimulationError(f"the normal of the plane must point up (z > 0), got {normal}.")
        object.__setattr__(self, "normal", frozen(normal / np.linalg.norm(normal)))

    @classmethod
    def slope(cls, angle: float, height: float = 0.0) -> Plane:
        """Return a plane that rises by tan(angle) along +x; angle in rad."""
        direction: ArrayLike = [-np.sin(angle), 0.0, np.cos(angle)]
        return cls(frozen(direction), height)

    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`."""
        return _numbered(PLANE, self.normal, self.height * self.normal[2])


@final
@dataclass(frozen=True, eq=False)
class Box(Solid):
    """A solid box. Let one that stands on other ground reach into it: seams then catch nothing.

    Attributes:
        center: (3,) [m], world.
        size: (3,) [m], whole lengths along its own axes.
        rotation: (3, 3) from its axes to the world's.
    """

    center: FloatArray
    size: FloatArray
    rotation: FloatArray = field(default_factory=lambda: frozen(np.eye(3)))

    def __post_init__(self) -> None:
        """Check and freeze."""
        for name, shape in (("center", (3,)), ("size", (3,)), ("rotation", (3, 3))):
            value = checked(getattr(self, name), shape, f"{name} of the box", SimulationError)
            object.__setattr__(self, name, value)
        if not np.all(self.size > 0.0):
            raise SimulationError(f"the size of the box must be positive, got {self.size}.")
        if not np.allclose(self.rotation @ self.rotation.T, np.eye(3), atol=1e-9):
            raise SimulationError("the rotation of the box is no rotation matrix.")

    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`."""
        half = 0.5 * self.size
        return _numbered(BOX, self.center, self.rotation, -half, half)


@final
@dataclass(frozen=True, eq=False)
class Sphere(Ranged, Solid):
    """A solid sphere.

    Attributes:
        center: (3,) [m], world.
        radius: [m].
    """

    center: FloatArray
    radius: float = field(metadata=must("> 0 m"))

    _told, _raised = "sphere: ", SimulationError

    def __post_init__(self) -> None:
        """Check and freeze."""
        center = checked(self.center, (3,), "center of the sphere", SimulationError)
        object.__setattr__(self, "center", center)
        super().__post_init__()

    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`; at the centre itself the way out is up."""
        return _numbered(BALL, self.center, self.radius)


class Together(Terrain):
    """Several grounds as one: a plane with boxes on it, say."""

    def __init__(self, parts: Sequence[Terrain]) -> None:
        """Collect the solids of `parts`.

        Raises:
            SimulationError: no parts.
        """
        if not parts:
            raise SimulationError("a ground is made of at least one part.")
        self._solids = tuple(solid for part in parts for solid in part.solids)

    @property
    def solids(self) -> tuple[Terrain, ...]:
        """See `Terrain.solids`."""
        return self._solids

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`; of the nearest solid."""
        found = zip(*(solid.gap(points) for solid in self.solids), strict=True)
        gaps, normals = map(np.array, found)
        first, every = np.argmin(gaps, axis=0), np.arange(len(points))
        return gaps[first, every], normals[first, every]


@final
@dataclass(frozen=True, eq=False)
class Stairs(Together):
    """Level treads with vertical risers between them.

    Attributes:
        edges: (s,) x [m] of the risers, increasing.
        heights: (s + 1,) z [m] of the treads, from x = -inf to x = +inf.
    """

    edges: FloatArray
    heights: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze."""
        edges = checked(self.edges, (None,), "edges of the stairs", SimulationError)
        heights = checked(self.heights, (len(edges) + 1,), "heights of the stairs", SimulationError)
        if np.any(np.diff(edges) <= 0.0):
            raise SimulationError(f"the edges of the stairs must increase, got {edges.tolist()}.")
        object.__setattr__(self, "edges", edges)
        object.__setattr__(self, "heights", heights)

    @cached_property
    def solids(self) -> tuple[Terrain, ...]:
        """One solid per tread: all that lies below it, as far as no tread nearby is lower.

        No face of one of these lies inside another, so that nothing can catch on a seam.
        """
        ends = [-np.inf, *self.edges.tolist(), np.inf]
        columns = {}
        for i, height in enumerate(self.heights.tolist()):
            first = last = i
            while first > 0 and self.heights[first - 1] >= height:
                first -= 1
            while last + 1 < len(self.heights) and self.heights[last + 1] >= height:
                last += 1
            columns[first, last] = _Column(ends[first], ends[last + 1], height)
        return tuple(columns.values())


@final
@dataclass(frozen=True, slots=True)
class _Column(Solid):
    """Everything below `height` between x = `low` and x = `high`."""

    low: float
    high: float
    height: float

    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`."""
        lowest, highest = (self.low, -np.inf, -np.inf), (self.high, np.inf, self.height)
        return _numbered(BOX, np.zeros(3), np.eye(3), lowest, highest)


@final
@dataclass(frozen=True, eq=False)
class HeightField(Solid):
    """A smooth surface z(x, y) through heights on a grid (cubic spline); level beyond its border.

    The gap is the distance from the nearest place of the surface, so that a ball whose centre is
    above the surface rolls without making energy. The slope is continuous, so that no point can
    catch on the grid.

    Attributes:
        x: (a,) [m] of the grid, increasing, a >= 4.
        y: (b,) [m], likewise.
        heights: (a, b) z [m] of the ground at (x, y).
    """

    x: FloatArray
    y: FloatArray
    heights: FloatArray
    _numbers: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check, freeze and lay the surface."""
        from scipy.interpolate import RectBivariateSpline  # other grounds do not wait for these
        from scipy.ndimage import maximum_filter

        for name in ("x", "y"):
            axis = checked(getattr(self, name), (None,), f"{name} of the grid", SimulationError)
            if len(axis) < 4 or np.any(np.diff(axis) <= 0.0):
                raise SimulationError(
                    f"{name} of the height field must increase and have at least four entries."
                )
            object.__setattr__(self, name, axis)
        shape = (len(self.x), len(self.y))
        heights = checked(self.heights, shape, "heights of the height field", SimulationError)
        object.__setattr__(self, "heights", heights)
        surface = RectBivariateSpline(self.x, self.y, heights, s=0.0)
        nodes = [surface(self.x, self.y, *order) for order in ((0, 0), (1, 0), (0, 1), (1, 1))]
        middles = 0.5 * (self.x[1:] + self.x[:-1]), 0.5 * (self.y[1:] + self.y[:-1])
        cells = [surface(*middles, *order) for order in ((0, 0), (1, 0), (0, 1))]
        finer = [
            np.sort(np.concatenate(two)) for two in zip((self.x, self.y), middles, strict=True)
        ]
        bends = [surface(*finer, *order) for order in ((2, 0), (1, 1), (0, 2))]
        bend = np.sqrt(bends[0] ** 2 + 2.0 * bends[1] ** 2 + bends[2] ** 2)
        most = maximum_filter(bend, 3)[1::2, 1::2]
        spacing = min(np.ptp(self.x) / (shape[0] - 1), np.ptp(self.y) / (shape[1] - 1))
        parts = (
            [FIELD, *shape, bend.max(), spacing], self.x, self.y,
            np.stack(nodes, axis=-1).ravel(), np.stack([*cells, most], axis=-1).ravel(),
        )  # fmt: skip
        object.__setattr__(self, "_numbers", frozen(np.concatenate(parts)))

    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`; the numbers of `wbc.sim.step.field`."""
        return self._numbers
