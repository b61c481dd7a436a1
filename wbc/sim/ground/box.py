"""A box, with its edges and corners."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import SimulationError
from wbc.sim.ground.terrain import Terrain


@final
@dataclass(frozen=True, eq=False)
class Box(Terrain):
    """A solid box. Let one that stands on other ground reach into it: seams then catch nothing.

    Attributes:
        center: (3,) [m], world.
        size: (3,) [m], whole lengths along its own axes.
        rotation: (3, 3) from its axes to the world's.
    """

    center: FloatArray
    size: FloatArray
    rotation: FloatArray = field(default_factory=lambda: frozen(np.eye(3)))

    def __post_init__(self) -> None:
        """Check and freeze."""
        for name, shape in (("center", (3,)), ("size", (3,)), ("rotation", (3, 3))):
            value = checked(getattr(self, name), shape, f"{name} of the box", SimulationError)
            object.__setattr__(self, name, value)
        if not np.all(self.size > 0.0):
            raise SimulationError(f"the size of the box must be positive, got {self.size}.")
        if not np.allclose(self.rotation @ self.rotation.T, np.eye(3), atol=1e-9):
            raise SimulationError("the rotation of the box is no rotation matrix.")

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`."""
        own = (points - self.center) @ self.rotation
        gaps, normals = away_from_box(-0.5 * self.size - own, own - 0.5 * self.size)
        return gaps, normals @ self.rotation.T


def away_from_box(lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gap (k,) and normal (k, 3) at points, by how far they are beyond each face.

    Outside, the way leads from the nearest face, edge or corner; inside, to the nearest face.

    Args:
        lower: (k, 3) beyond the faces at the lower ends, -inf where there is none.
        upper: (k, 3) beyond those at the upper ends.
    """
    beyond = np.maximum(lower, upper)
    sign = np.where(upper >= lower, 1.0, -1.0)
    outside = np.maximum(beyond, 0.0)
    distance = np.sqrt((outside * outside).sum(axis=1))
    nearest_face = np.argmax(beyond, axis=1)
    every = np.arange(len(beyond))
    normals = np.zeros(beyond.shape)
    normals[every, nearest_face] = sign[every, nearest_face]
    away = distance > 0.0
    normals[away] = (sign * outside)[away] / distance[away, None]
    return np.where(away, distance, beyond[every, nearest_face]), normals
