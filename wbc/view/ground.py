"""The ground of a scene: how high it is, and the thin slabs that it is drawn as."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import ViewError
from wbc.sim.ground import Plane, Stairs, Terrain
from wbc.view.shapes import along

_THICKNESS = 0.02


class GroundSlab(NamedTuple):
    """A thin box whose upper face is walked on.

    Attributes:
        placement: of the middle of the box, world.
        sides: (3,) [m] lengths.
    """

    placement: pin.SE3
    sides: FloatArray


def surface(terrain: Terrain | None, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return heights (k,) [m] and unit normals (k, 3) of the ground below or above points (k, 3).

    Without a ground they are zero and vertical. Nobody stands on a riser.

    Raises:
        ViewError: a kind of terrain that has no picture yet.
    """
    heights, normal = np.zeros(len(points)), np.array([0.0, 0.0, 1.0])
    match terrain:
        case None:
            pass
        case Plane():
            normal = np.asarray(terrain.normal)
            heights = terrain.height - points[:, :2] @ normal[:2] / normal[2]
        case Stairs():
            heights = terrain.heights[np.searchsorted(terrain.edges, points[:, 0])]
        case _:
            raise ViewError(
                f"no picture of a {type(terrain).__name__}; give a Plane or Stairs to stand on."
            )
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
        return (_slab(along(normals[0]), [*center[:2], heights[0]], size, size),)
    low, high = center[0] - 0.5 * size, center[0] + 0.5 * size
    ends = [low, *(x for x in terrain.edges.tolist() if low < x < high), high]
    middles = [0.5 * (a + b) for a, b in pairwise(ends)]
    heights, _ = surface(terrain, np.array(middles)[:, None])
    slabs = [
        _slab(np.eye(3), [x, 0.0, z], b - a, size)
        for x, z, (a, b) in zip(middles, heights, pairwise(ends), strict=True)
    ]
    for x, (below, above) in zip(ends[1:-1], pairwise(heights), strict=True):
        if below != above:  # a riser, which faces the lower side
            turn = np.asarray(pin.utils.rotate("y", -0.5 * np.pi * np.sign(above - below)))
            middle = [x, 0.0, 0.5 * (below + above)]
            slabs.append(_slab(turn, middle, abs(above - below), size))
    return tuple(slabs)


def _slab(turn: FloatArray, face: list[float], length: float, width: float) -> GroundSlab:
    """Return the slab whose upper face has its middle at `face`; z of `turn` is its normal."""
    middle = np.asarray(face) - 0.5 * _THICKNESS * turn[:, 2]
    return GroundSlab(pin.SE3(turn, middle), np.array([length, width, _THICKNESS]))
