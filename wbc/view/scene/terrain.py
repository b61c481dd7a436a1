"""The simulator's ground as slabs to draw."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import ViewError
from wbc.sim.ground.plane import Plane
from wbc.sim.ground.stairs import Stairs
from wbc.sim.ground.terrain import Terrain
from wbc.view.scene.geometry import along
from wbc.view.scene.ground import GroundSlab, profile_ground, slab_below


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
