"""Steps along x, each level across y."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray, checked
from wbc.errors import SimulationError
from wbc.sim.ground.terrain import Terrain


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

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`; the tread below a point, or the riser beside it where that is nearer.

        A riser counts while the point is below its upper edge; inside the ground the face with
        the least depth is the one the point came through.
        """
        gaps, normals = np.empty(len(points)), np.zeros(points.shape)
        for i, (x, _, z) in enumerate(points):
            tread = int(np.searchsorted(self.edges, x))
            gaps[i], normals[i] = z - self.heights[tread], (0.0, 0.0, 1.0)
            for edge, behind, way in self._faces(tread, z, inside=gaps[i] < 0.0):
                distance = behind * (x - edge)
                if abs(distance) < abs(gaps[i]):
                    gaps[i], normals[i] = distance, (way, 0.0, 0.0)
        return gaps, normals

    def _faces(self, tread: int, z: float, inside: bool) -> list[tuple[float, float, float]]:
        """Return (x, sign of the gap along x, normal's x) of the risers that face the point."""
        faces = []
        for neighbour, edge in ((tread - 1, tread - 1), (tread + 1, tread)):
            if not 0 <= neighbour < len(self.heights):
                continue
            out = 1.0 if neighbour > tread else -1.0
            if not inside and z < self.heights[neighbour]:
                faces.append((float(self.edges[edge]), -out, -out))
            if inside and z > self.heights[neighbour]:
                faces.append((float(self.edges[edge]), out, out))
        return faces
