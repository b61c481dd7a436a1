"""The ground of a scene as thin slabs; slopes and steps are a profile along x."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import ViewError
from wbc.sim.ground import Plane, Stairs, Terrain
from wbc.view.shapes import along

_THICKNESS = 0.02
_UPRIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class GroundSlab:
    """A thin box whose upper face is walked on.

    Attributes:
        placement: of the middle of the box, world.
        sides: (3,) [m] lengths.
    """

    placement: pin.SE3
    sides: FloatArray

    @property
    def normal(self) -> FloatArray:
        """Unit normal of the upper face (3,), world."""
        return np.asarray(self.placement.rotation[:, 2])


def slab_below(face: pin.SE3, length: float, width: float) -> GroundSlab:
    """Return the slab whose upper face has its middle and its normal (z) at `face`."""
    middle = face.act(np.array([0.0, 0.0, -0.5 * _THICKNESS]))
    return GroundSlab(pin.SE3(face.rotation, middle), np.array([length, width, _THICKNESS]))


def flat_ground(height: float, center: Sequence[float], size: float) -> tuple[GroundSlab, ...]:
    """Return one level slab of `size` [m] around the x, y of `center`."""
    face = pin.SE3(np.eye(3), np.array([center[0], center[1], height]))
    return (slab_below(face, size, size),)


def profile_ground(profile: Sequence[tuple[float, float]], width: float) -> tuple[GroundSlab, ...]:
    """Return the slabs under a profile: a polygon line through points (x, z) [m], x not falling.

    A vertical piece is the riser of a step.

    Args:
        profile: two points or more, for example [(-1, 0), (0, 0), (0, 0.1), (1, 0.1)].
        width: [m] along y.

    Raises:
        ViewError: fewer than two points, x that falls, or what is not finite.
    """
    points = np.asarray(profile, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2:
        raise ViewError(f"a ground profile needs two points (x, z) or more, got {list(profile)}.")
    steps = np.diff(points, axis=0)
    if not (np.isfinite(points).all() and np.all(steps[:, 0] >= 0.0)):
        raise ViewError(
            "a ground profile runs along x: x must not fall from point to point, and all is finite."
        )
    slabs = []
    for (x, z), (dx, dz) in zip(points[:-1], steps, strict=True):
        if dx == 0.0:
            if dz != 0.0:
                slabs.append(_riser(x, z, dz, width))
            continue
        turn = np.asarray(pin.utils.rotate("y", -float(np.arctan2(dz, dx))))
        middle = np.array([x + 0.5 * dx, 0.0, z + 0.5 * dz])
        slabs.append(slab_below(pin.SE3(turn, middle), float(np.hypot(dx, dz)), width))
    return tuple(slabs)


def _riser(x: float, z: float, rise: float, width: float) -> GroundSlab:
    """Return the upright slab at `x` from `z` up (or down) by `rise`, facing the lower side."""
    turn = np.asarray(pin.utils.rotate("y", -0.5 * np.pi * float(np.sign(rise))))
    face = pin.SE3(turn, np.array([x, 0.0, z + 0.5 * rise]))
    return slab_below(face, abs(rise), width)


def surface_under(slabs: Sequence[GroundSlab], point: FloatArray) -> tuple[float, FloatArray]:
    """Return height [m] and unit normal (3,) of the ground below or above a point (3,).

    Outside every slab the nearest one is taken; without any, height 0 and the vertical. Nobody
    stands on a riser.
    """
    nearest, best = (0.0, np.array([0.0, 0.0, 1.0])), np.inf
    for slab in slabs:
        if slab.normal[2] < _UPRIGHT:
            continue
        local = slab.placement.actInv(point)
        outside = np.maximum(np.abs(local[:2]) - 0.5 * slab.sides[:2], 0.0)
        distance = float(np.hypot(*outside))
        if distance >= best:
            continue
        best = distance
        normal = slab.normal
        top = slab.placement.translation + 0.5 * slab.sides[2] * normal
        slope = normal[:2] @ (top[:2] - np.asarray(point)[:2]) / normal[2]
        nearest = (float(top[2] + slope), normal)
    return nearest


def terrain_slabs(terrain: Terrain, center: FloatArray, size: float) -> tuple[GroundSlab, ...]:
    """Return the slabs of a terrain within a square of `size` [m] around x, y of `center`.

    Raises:
        ViewError: a kind of terrain that has no picture yet.
    """
    match terrain:
        case Plane():
            slope = terrain.normal[:2] @ center[:2] / terrain.normal[2]
            middle = np.array([center[0], center[1], terrain.height - slope])
            return (slab_below(pin.SE3(along(terrain.normal), middle), size, size),)
        case Stairs():
            low, high = center[0] - 0.5 * size, center[0] + 0.5 * size
            inner = [float(x) for x in terrain.edges if low < x < high]
            first = int(np.searchsorted(terrain.edges, low))
            points = [(low, float(terrain.heights[first]))]
            for i, edge in enumerate(inner):
                points += [(edge, float(terrain.heights[first + i + k])) for k in (0, 1)]
            points.append((high, points[-1][1]))
            return profile_ground(points, size)
    raise ViewError(
        f"no picture of a {type(terrain).__name__}; give the ground as slabs "
        "(flat_ground, profile_ground)."
    )
