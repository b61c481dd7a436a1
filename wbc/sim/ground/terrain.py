"""The ground: how far a point is from it, and which way is out of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError


class Terrain(ABC):
    """A rigid ground.

    A ground is made of solids. Each solid is a barrier of its own for every contact point, so that
    a point in a corner touches two of them, and one that slides from one solid to the next lands
    on it. The gap of one solid should be continuous.
    """

    @abstractmethod
    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return distance and normal at points.

        Args:
            points: (k, 3) [m], world.

        Returns:
            gap (k,) [m], negative inside the ground, and the unit normal (k, 3) out of the ground.
        """

    @property
    def solids(self) -> tuple[Terrain, ...]:
        """What the ground is made of; one solid unless a ground says more."""
        return (self,)

    def at(self, time: float) -> Terrain:
        """Return the ground as it lies at a time [s]; itself unless it moves."""
        return self

    def velocity(self, points: FloatArray, time: float, later: float) -> FloatArray | None:
        """Return how fast ground moves that lies at points (k, 3) at a time: (k, 3) [m/s], world.

        None for ground that never moves.

        Args:
            points: (k, 3) [m], world.
            time: [s] at which the ground lies there.
            later: [s] of the velocity.
        """
        return None


@final
class Together(Terrain):
    """Several grounds as one: a plane with boxes on it, say."""

    def __init__(self, parts: Sequence[Terrain]) -> None:
        """Collect the solids of `parts`.

        Raises:
            SimulationError: no parts.
        """
        if not parts:
            raise SimulationError("a ground is made of at least one part.")
        self._solids = tuple(solid for part in parts for solid in part.solids)

    @property
    def solids(self) -> tuple[Terrain, ...]:
        """See `Terrain.solids`."""
        return self._solids

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`; of the nearest solid."""
        return nearest(self._solids, points)


def nearest(solids: tuple[Terrain, ...], points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gap (k,) and normal (k, 3) of the solid nearest to each point (k, 3)."""
    found = [solid.gap(points) for solid in solids]
    gaps = np.array([gap for gap, _ in found])
    first, every = np.argmin(gaps, axis=0), np.arange(len(points))
    normals = np.array([normal for _, normal in found])
    return gaps[first, every], normals[first, every]
