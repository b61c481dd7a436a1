"""Steps along x, each level across y."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from wbc.arrays import FloatArray, checked
from wbc.errors import SimulationError
from wbc.sim.ground.box import away_from_box
from wbc.sim.ground.terrain import Terrain, nearest


@final
@dataclass(frozen=True, eq=False)
class Stairs(Terrain):
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

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`; of the nearest solid."""
        return nearest(self.solids, points)


@final
@dataclass(frozen=True, slots=True)
class _Column(Terrain):
    """Everything below `height` between x = `low` and x = `high`."""

    low: float
    high: float
    height: float

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`."""
        across = np.zeros(len(points))
        upper = np.stack((points[:, 0] - self.high, across - np.inf, points[:, 2] - self.height), 1)
        lower = np.stack((self.low - points[:, 0], across - np.inf, across - np.inf), 1)
        return away_from_box(lower, upper)
