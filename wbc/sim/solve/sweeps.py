"""Row-by-row sweeps (non-smooth Gauss-Seidel): slow, but every sweep goes downhill."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.laws.elements import Elements, meeting_speed, modes_at
from wbc.sim.solve.reduced import Reduced


def sweep(reduced: Reduced, start: FloatArray, count: int) -> FloatArray:
    """Return the row impulses after `count` sweeps over all rows from `start` (r,).

    An element or a normal is solved exactly with all others held; a contact's tangents by one
    projection onto the disc that its normal impulse allows.
    """
    impulse = start.copy()
    parts = [_row(reduced.program.elements, i) for i in range(reduced.elements)]
    for _ in range(count):
        for i, element in enumerate(parts):
            slope = reduced.slope[i : i + 1]
            speed = reduced.free[i] + reduced.delassus[i] @ impulse
            rest = speed - reduced.delassus[i, i] * impulse[i]
            impulse[i] = _meet(element, rest, reduced.delassus[i, i], slope)
        _contacts(reduced, impulse)
    return impulse


def _row(elements: Elements, i: int) -> Elements:
    fields = (getattr(elements, name)[i : i + 1] for name in Elements.__slots__)
    return Elements(*fields)


def _meet(element: Elements, rest: float, compliance: float, slope: FloatArray) -> float:
    """Return T of one law in series with u = rest + compliance T."""
    line = np.array([1.0 / compliance]) if compliance > 0.0 else slope
    point, line = element.through_springs(np.array([-rest]) * line, line)
    modes = modes_at(element, point, line)
    return float((point + line * meeting_speed(element, modes, point, line))[0])


def _contacts(reduced: Reduced, impulse: FloatArray) -> None:
    unilateral, first = reduced.program.unilateral, reduced.normal_rows.start
    for j in range(reduced.limits + reduced.contacts):
        i = first + j
        speed = reduced.free[i] + reduced.delassus[i] @ impulse
        push = impulse[i] - reduced.slope[i] * (speed - unilateral.target[j])
        impulse[i] = max(push, 0.0)
        contact = j - reduced.limits
        if contact < 0 or reduced.tangents == 0:
            continue
        start = reduced.tangent_rows.start + contact * reduced.tangents
        rows = slice(start, start + reduced.tangents)
        slip = reduced.free[rows] + reduced.delassus[rows] @ impulse
        wish = impulse[rows] - reduced.slope[rows] * slip
        bound = unilateral.friction[contact] * impulse[i]
        size = float(np.sqrt(wish @ wish))
        impulse[rows] = wish if size <= bound else wish * (bound / size)
