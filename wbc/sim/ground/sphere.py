"""A ball to stand on or run into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray, checked
from wbc.errors import SimulationError
from wbc.sim.ground.terrain import Terrain


@final
@dataclass(frozen=True, eq=False)
class Sphere(Terrain):
    """A solid sphere.

    Attributes:
        center: (3,) [m], world.
        radius: [m].
    """

    center: FloatArray
    radius: float

    def __post_init__(self) -> None:
        """Check and freeze."""
        center = checked(self.center, (3,), "center of the sphere", SimulationError)
        object.__setattr__(self, "center", center)
        if not self.radius > 0.0:
            raise SimulationError(f"the radius of the sphere must be positive, got {self.radius}.")

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`; at the centre itself the way out is up."""
        way = points - self.center
        distance = np.linalg.norm(way, axis=1)
        way[distance == 0.0] = [0.0, 0.0, 1.0]
        return distance - self.radius, way / np.where(distance > 0.0, distance, 1.0)[:, None]
