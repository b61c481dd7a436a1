"""Ground given by heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import maximum_filter

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import SimulationError
from wbc.sim.ground import FIELD, Solid


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
        parts = (
            [FIELD, *shape], self.x, self.y, np.stack(nodes, axis=-1).ravel(), [bend.max()],
            np.stack([*cells, most], axis=-1).ravel(),
        )  # fmt: skip
        object.__setattr__(self, "_numbers", frozen(np.concatenate(parts)))

    def numbers(self) -> FloatArray:
        """See `Terrain.numbers`; the numbers of `wbc.sim.step.field`."""
        return self._numbers
