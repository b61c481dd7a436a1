"""Row impulses between steps: laid out for all rows a robot can have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.sim.ground.barriers import Barriers, ClosedRows
from wbc.sim.laws.gear_rows import GearRows


@dataclass(frozen=True, eq=False, slots=True)
class ImpulseLayout:
    """Where each row sits in `SimState.impulse`: gears, coordinates, barriers, tangents.

    Attributes:
        coordinates: place of the first coordinate with friction of its own.
        limits: place of the first joint limit.
        normals: place of the first contact normal.
        tangents: (c, d) places of the contact tangents, per point and solid.
        size: of the whole.
    """

    coordinates: int
    limits: int
    normals: int
    tangents: IntArray
    size: int

    @classmethod
    def of(cls, gears: int, coordinates: int, barriers: Barriers) -> ImpulseLayout:
        """Return the layout for m `gears`, nv `coordinates` and the barriers."""
        limits = gears + coordinates
        first, d = limits + barriers.size, 1 if barriers.planar else 2
        tangents = first + np.arange(d * barriers.contacts).reshape(-1, d)
        return cls(gears, limits, limits + barriers.limits, tangents, first + tangents.size)

    def places(self, gears: GearRows, closed: ClosedRows) -> IntArray:
        """Return the places (r,) of the rows of a step."""
        parts = [gears.engaged]
        if len(gears.alone):
            parts.append(self.coordinates + gears.alone)
        if len(closed.limits):
            parts.append(self.limits + closed.limits)
        if len(closed.which):
            parts += [self.normals + closed.which, self.tangents[closed.which].ravel()]
        return np.concatenate(parts)

    def store(self, impulse: FloatArray, places: IntArray) -> FloatArray:
        """Return row impulses (r,) in this layout, zero where a row is not there."""
        stored = np.zeros(self.size)
        stored[places] = impulse
        return stored

    def recall(self, stored: FloatArray, places: IntArray) -> FloatArray | None:
        """Return a start for the rows of a step, None where nothing fitting is stored."""
        return np.asarray(stored[places]) if len(stored) == self.size else None
