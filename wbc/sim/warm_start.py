"""Row impulses between steps: laid out for all rows a robot can have."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.sim.gear_rows import GearRows
from wbc.sim.ground import ContactRows
from wbc.sim.setup import Setup


def row_places(setup: Setup, gears: GearRows, contacts: ContactRows, limits: IntArray) -> IntArray:
    """Return where the rows of a step (r,) sit in the layout of `SimState.impulse`."""
    m, nv, barriers = setup.drive.size, setup.space.model.nv, setup.barriers
    first = m + nv
    tangents = first + barriers.size
    d = 1 if barriers.planar else 2
    which = contacts.which
    return np.concatenate(
        (
            gears.engaged,
            m + gears.alone,
            first + limits,
            first + barriers.limits + which,
            (tangents + d * which[:, None] + np.arange(d)).ravel(),
        )
    )


def store_impulse(setup: Setup, impulse: FloatArray, places: IntArray) -> FloatArray:
    """Return row impulses (r,) in the layout of `SimState.impulse`."""
    stored = np.zeros(setup.stored_size)
    stored[places] = impulse
    return stored


def recall_impulse(setup: Setup, stored: FloatArray, places: IntArray) -> FloatArray | None:
    """Return a start for the rows of a step, None where nothing fitting is stored."""
    if len(stored) != setup.stored_size:
        return None
    return np.asarray(stored[places])
