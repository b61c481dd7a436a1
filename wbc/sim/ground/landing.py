"""Which barriers land within a part of a step, and how far on the way the first one does."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.compiled import Count, Flags, Number, OutFlags, OutRow, Row, compiled
from wbc.sim.ground.barriers import TOUCH

FAST, SLOW = range(2)


@compiled(Count, Flags, Flags, Row, Row, Count, Number, OutFlags, counted=False)
def landing_of(
    closed: BoolArray,
    kept: BoolArray,
    start: FloatArray,
    end: FloatArray,
    limits: int,
    short: float,
    landing: BoolArray,
) -> int:
    """Write which barriers land; return SLOW where only points do, none from farther than `short`.

    Args:
        closed, kept: (2 j + c,) barriers that hold already.
        start, end: (2 j + c,) gaps.
        limits: 2 j, of the joint limits, which come first.
        short: [m].
        landing: (2 j + c,) to write.
    """
    found, slowly = False, True
    for i in range(len(end)):
        landing[i] = not closed[i] and not kept[i] and end[i] < -TOUCH
        if landing[i]:
            found = True
            slowly = slowly and i >= limits and start[i] - end[i] <= short
    return SLOW if found and slowly else FAST


@compiled(Number, Flags, Flags, Row, Row, OutRow, counted=False)
def nearest(
    closed: BoolArray, kept: BoolArray, start: FloatArray, gap: FloatArray, ahead: FloatArray
) -> float:
    """Write gaps (2 j + c,) of the barriers ahead, infinite for others; return the least.

    An overlap at the start is on its way out; what is written counts from there.
    """
    least = np.inf
    for i in range(len(gap)):
        ahead[i] = np.inf if closed[i] or kept[i] else gap[i] - min(start[i], 0.0)
        least = min(least, ahead[i])
    return least


@compiled(Number, Row, Row, counted=False)
def first_crossing(early: FloatArray, late: FloatArray) -> float:
    """Return the share of the way at which the first gap closes, linearly between two ends."""
    first = 1.0
    for i in range(len(late)):
        if late[i] < 0.0:
            gap = max(early[i], 0.0)
            first = min(first, gap / (gap - late[i]))
    return min(max(first, 1e-4), 1.0 - 1e-4)
