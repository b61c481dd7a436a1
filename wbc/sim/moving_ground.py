"""Ground that moves as it is told, whatever stands on it: belts, lifts, tables that tilt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.ground import Terrain, nearest

_MOMENT = 1e-5
"""[s] before and after a time, between which the motion is taken as even: a speed is then right
within 1e-10 of its third derivative, and rounding leaves 1e-11 of the way."""


@final
@dataclass(frozen=True, eq=False)
class Moving(Terrain):
    """A rigid ground on a prescribed motion. The power that it takes is a line of the balance.

    A belt is a plane that is shifted along itself.

    Attributes:
        ground: the ground in its own axes.
        pose: returns the placement (a `pin.SE3`) of these axes in the world at a time [s]; without
            jumps. Its speed is taken from it.
    """

    ground: Terrain
    pose: Callable[[float], pin.SE3]

    @property
    def solids(self) -> tuple[Terrain, ...]:
        """See `Terrain.solids`; each moves alike."""
        parts = self.ground.solids
        return (self,) if len(parts) == 1 else tuple(Moving(part, self.pose) for part in parts)

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`; at time zero."""
        return self.at(0.0).gap(points)

    def at(self, time: float) -> Terrain:
        """See `Terrain.at`.

        Raises:
            SimulationError: `pose` returns no placement.
        """
        own = self.ground.at(time)
        return _Placed(own, self._placed(time))

    def velocity(self, points: FloatArray, time: float, later: float) -> FloatArray:
        """See `Terrain.velocity`."""
        now = self._placed(time)
        own = (points - now.translation) @ now.rotation
        early, late = (self._placed(later + sign * _MOMENT) for sign in (-1.0, 1.0))
        path = [own @ pose.rotation.T + pose.translation for pose in (early, late)]
        moved = np.asarray((path[1] - path[0]) / (2.0 * _MOMENT))
        inner = self.ground.velocity(own, time, later)
        return moved if inner is None else moved + inner @ self._placed(later).rotation.T

    def _placed(self, time: float) -> pin.SE3:
        found = self.pose(time)
        if not isinstance(found, pin.SE3):
            raise SimulationError(
                f"pose({time:g}) of the moving ground returned a {type(found).__name__}; it must "
                "return a pin.SE3, the placement of the ground in the world."
            )
        if not np.isfinite(found.homogeneous).all():
            raise SimulationError(f"pose({time:g}) of the moving ground is not finite:\n{found}")
        return found


@final
@dataclass(frozen=True, eq=False)
class _Placed(Terrain):
    """A ground at a place in the world."""

    ground: Terrain
    place: pin.SE3

    def gap(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Terrain.gap`."""
        turn = self.place.rotation
        gap, normal = nearest(self.ground.solids, (points - self.place.translation) @ turn)
        return gap, normal @ turn.T
