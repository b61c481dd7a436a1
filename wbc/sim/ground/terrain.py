"""The ground: how far a point is from it, and which way is out of it."""

from __future__ import annotations

from abc import ABC, abstractmethod

from wbc.arrays import FloatArray


class Terrain(ABC):
    """A rigid, fixed ground."""

    @abstractmethod
    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return distance and normal at points.

        Args:
            points: (k, 3) [m], world.

        Returns:
            gap (k,) [m], negative inside the ground, and the unit normal (k, 3) out of the ground.
        """
