"""Flat ground, level or sloped."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import SimulationError
from wbc.sim.ground.terrain import Terrain


@final
@dataclass(frozen=True, eq=False)
class Plane(Terrain):
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

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`."""
        distance = points @ self.normal
        distance -= self.height * self.normal[2]
        normals = np.empty((len(points), 3))
        normals[:] = self.normal
        return distance, normals
