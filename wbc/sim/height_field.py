"""Ground given by heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from scipy.interpolate import RectBivariateSpline

from wbc.arrays import FloatArray, checked
from wbc.errors import SimulationError
from wbc.sim.ground import Terrain

_ROUNDS = 12  # of Newton's iteration, which settles in 1 to 4 where a place is near
_SETTLED = 1e-7  # [m]; the next step would be about this, squared, over the radius of curvature
_DERIVATIVES = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)


@final
@dataclass(frozen=True, eq=False)
class HeightField(Terrain):
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
        foot = self._nearest(points)
        height, slope, _ = self._local(foot)
        normals = np.concatenate((-slope, np.ones((len(points), 1))), axis=1)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        way = points - np.column_stack((foot, height))
        return (way * normals).sum(axis=1), normals

    def _nearest(self, points: FloatArray) -> FloatArray:
        """Return where (k, 2) the surface is nearest to points (k, 3), by Newton's iteration.

        The way from the surface to a point is at right angles to the surface there,
        (x, y) - p_xy + (z - p_z) grad z = 0. Where the iteration does not settle at a least
        distance (a point above a hollow is as near to two sides), or finds a place that is farther
        away, it is straight below the point.
        """
        below, foot = points[:, :2], points[:, :2]
        first = deep = self._local(below)[0] - points[:, 2]
        lost = settled = np.zeros(len(points), dtype=bool)
        for _ in range(_ROUNDS):
            height, slope, bend = self._local(foot)
            deep = height - points[:, 2]
            missing = foot - below + deep[:, None] * slope
            turning = np.eye(2) + slope[:, :, None] * slope[:, None] + deep[:, None, None] * bend
            (a, b), (_, d) = turning.transpose(1, 2, 0)
            whole = a * d - b * b
            lost = lost | ~((whole > 0.0) & (a > 0.0))
            x, y = (missing / np.where(lost, 1.0, whole)[:, None]).T
            step = np.column_stack((d * x - b * y, a * y - b * x))
            foot = np.where(lost[:, None], below, foot - step)
            settled = np.abs(step).max(axis=1) <= _SETTLED
            if np.all(settled | lost):
                break
        nearer = (deep * first >= 0.0) & (((foot - below) ** 2).sum(axis=1) + deep**2 <= first**2)
        return np.where((settled & ~lost & nearer)[:, None], foot, below)

    def _local(self, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return z (k,), slope (k, 2) and second derivatives (k, 2, 2) at (x, y) (k, 2)."""
        x = np.clip(at[:, 0], self.x[0], self.x[-1])
        y = np.clip(at[:, 1], self.y[0], self.y[-1])
        found = [self._surface(x, y, dx=a, dy=b, grid=False) for a, b in _DERIVATIVES]
        inside = np.column_stack((x, y)) == at
        slope, bend = np.column_stack(found[1:3]), np.column_stack((*found[3:5], *found[4:]))
        both = inside[:, :, None] & inside[:, None]
        return np.asarray(found[0]), slope * inside, bend.reshape(-1, 2, 2) * both
