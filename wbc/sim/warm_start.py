"""Row impulses between steps: laid out for all rows a robot can have."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.sim.gear_rows import GearRows
from wbc.sim.ground import ContactRows
from wbc.sim.setup import Setup
from wbc.sim.solution import StepSolution


def _places(
    setup: Setup, gears: GearRows, contacts: ContactRows, limits: IntArray
) -> tuple[IntArray, ...]:
    """Return where the rows of a step sit in the layout, in the order of the rows."""
    m, nv, barriers = setup.drive.size, setup.space.model.nv, setup.barriers
    first = m + nv
    tangents = first + barriers.size
    d = 1 if barriers.planar else 2
    which = contacts.which
    return (
        gears.engaged,
        m + gears.alone,
        first + limits,
        first + barriers.limits + which,
        (tangents + d * which[:, None] + np.arange(d)).ravel(),
    )


def store_impulse(
    setup: Setup,
    solution: StepSolution,
    gears: GearRows,
    contacts: ContactRows,
    limits: IntArray,
) -> FloatArray:
    """Return the row impulses of a solution in the layout of `SimState.impulse`."""
    stored = np.zeros(setup.stored_size)
    stored[np.concatenate(_places(setup, gears, contacts, limits))] = solution.impulse
    return stored


def recall_impulse(
    setup: Setup,
    stored: FloatArray,
    gears: GearRows,
    contacts: ContactRows,
    limits: IntArray,
) -> FloatArray | None:
    """Return a start for the rows of a step, None where nothing fitting is stored."""
    if len(stored) != setup.stored_size:
        return None
    return np.asarray(stored[np.concatenate(_places(setup, gears, contacts, limits))])
