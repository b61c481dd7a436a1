"""Ground given by heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from scipy.interpolate import RectBivariateSpline

from wbc.arrays import FloatArray, checked
from wbc.errors import SimulationError
from wbc.sim.ground.terrain import Terrain


@final
@dataclass(frozen=True, eq=False)
class HeightField(Terrain):
    """A smooth surface z(x, y) through heights on a grid (cubic spline); level beyond its border.

    The gap is the height above the surface times the normal's z: exact on slopes, to first order
    in the curvature elsewhere. The slope is continuous, so that no point can catch on the grid.

    Attributes:
        x: (a,) [m] of the grid, increasing, a >= 4.
        y: (b,) [m], likewise.
        heights: (a, b) z [m] of the ground at (x, y).
    """

    x: FloatArray
    y: FloatArray
    heights: FloatArray
    _surface: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check, freeze and lay the surface."""
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
        object.__setattr__(self, "_surface", RectBivariateSpline(self.x, self.y, heights, s=0.0))

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`."""
        x = np.clip(points[:, 0], self.x[0], self.x[-1])
        y = np.clip(points[:, 1], self.y[0], self.y[-1])
        slope_x = np.where(x == points[:, 0], self._surface(x, y, dx=1, grid=False), 0.0)
        slope_y = np.where(y == points[:, 1], self._surface(x, y, dy=1, grid=False), 0.0)
        normals = np.stack((-slope_x, -slope_y, np.ones(len(points))), axis=1)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        return (points[:, 2] - self._surface(x, y, grid=False)) * normals[:, 2], normals
